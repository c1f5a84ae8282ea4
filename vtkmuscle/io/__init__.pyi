from .fibre_table import (
    muscle_summary as muscle_summary,
    write_fibre_table as write_fibre_table,
)
from .landmarks import (
    read_aponeurosis as read_aponeurosis,
    read_landmarks as read_landmarks,
    read_named_points as read_named_points,
)
from .literature import (
    LITERATURE_COLUMNS as LITERATURE_COLUMNS,
    LiteratureCurve as LiteratureCurve,
    curves_for as curves_for,
    read_literature as read_literature,
    write_literature as write_literature,
)
from .motion_table import (
    motion_columns as motion_columns,
    read_motion_table as read_motion_table,
    write_motion_table as write_motion_table,
)
from .msf import read_msf as read_msf
from .surfaces import (
    SURFACE_SUFFIXES as SURFACE_SUFFIXES,
    Series as Series,
    read_polydata as read_polydata,
    read_surface as read_surface,
)
from .writing import Outputs as Outputs, write_polydata as write_polydata, write_text as write_text
