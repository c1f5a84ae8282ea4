from .frames import RunOptions as RunOptions, frame_numbers as frame_numbers
from .muscles import muscle_pipeline as muscle_pipeline
from .result import Result as Result
from .steps import ONLY as ONLY, run_only as run_only, run_scene as run_scene
from .table import MomentArmTable as MomentArmTable, Table as Table
