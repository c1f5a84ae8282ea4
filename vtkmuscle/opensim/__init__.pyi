from .checking import ModelCheck as ModelCheck, check_model as check_model
from .export_parts import ExportedMuscle as ExportedMuscle
from .from_run import Export as Export, export as export
from .mjcf import MujocoModel as MujocoModel, mjcf_of as mjcf_of, read_mjcf as read_mjcf
from .model import (
    MotionFile as MotionFile,
    OsimModel as OsimModel,
    read_motion_file as read_motion_file,
    read_osim as read_osim,
)
from .osim_text import MuscleOut as MuscleOut, enriched as enriched, osim_of as osim_of
