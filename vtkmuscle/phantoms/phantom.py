"""A scene made by a rule, with known answers: bones, muscles, attachments and a motion."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import multiblock_from, surface_from
from vtkmuscle.data.attachments import AttachmentArea, attachments_from

#: A number, a function, or values by name.
Answer = float | Callable[..., float] | Mapping[str, Floats]
#: Points (n, 3) [mm] and triangles (m, 3).
Surface = tuple[Floats, Ints]


@dataclass(frozen=True, eq=False)
class Phantom:
    """A scene made by a rule, in mm.

    Attributes
    ----------
    name : str
        Name of the phantom.
    bones, muscles : vtkMultiBlockDataSet, dict of str to vtkPolyData
        Closed surfaces by name, in the rest pose.
    attachments : dict of str to vtkMultiBlockDataSet
        Per muscle its areas, as filters take them.
    motion : RigidMotion
        Of the bones; the times are degrees, or numbers of frames for a motion with several coordinates.
    templates : dict of str to str
        Per muscle the kind of its fibre template.
    known : dict
        The answers: numbers, and functions, most of them of the angle [degrees]. Where the motion has several
        coordinates, ``known["coordinates"]`` has the coordinates' values at each time, by name, and functions
        take the coordinates in the same order.
    superficial : dict of str to vtkPolyData
        Per muscle the visible fibres on its surface, for muscles with visible fibres.
    """

    name: str
    bones: vtkMultiBlockDataSet
    muscles: dict[str, vtkPolyData]
    attachments: dict[str, vtkMultiBlockDataSet]
    motion: RigidMotion
    templates: dict[str, str]
    known: dict[str, Answer] = field(default_factory=dict)
    superficial: dict[str, vtkPolyData] = field(default_factory=dict)


def phantom_from(
    name: str, bones: Mapping[str, Surface], muscles: Mapping[str, Surface],
    areas: Mapping[str, Sequence[AttachmentArea]], motion: RigidMotion, known: Mapping[str, Answer],
    template: str = "parallel", superficial: Mapping[str, vtkPolyData] | None = None,
) -> Phantom:  # fmt: skip
    """Return a phantom from points and triangles, with data sets of its own."""
    bone_data = multiblock_from({bone: surface_from(*surface) for bone, surface in bones.items()})
    muscle_data = {muscle: surface_from(*surface) for muscle, surface in muscles.items()}
    attachments = {muscle: attachments_from(parts) for muscle, parts in areas.items()}
    scene = name, bone_data, muscle_data, attachments, motion, dict.fromkeys(muscles, template)
    return Phantom(*scene, dict(known), dict(superficial or {}))


def ends(origin: str, origin_ring: Floats, insertion: str, insertion_ring: Floats) -> list[AttachmentArea]:
    """Return a muscle's areas from bones and rings of landmarks (k, 3) [mm]."""
    rings = ("origin", origin, origin_ring), ("insertion", insertion, insertion_ring)
    return [AttachmentArea(*ring, closed=True) for ring in rings]


def circle(radius: float, count: int = 12) -> Floats:
    """Return points (count, 3) on a circle about the z axis, at z = 0 [mm]."""
    turns = 2.0 * np.pi * np.arange(count) / count
    return np.column_stack([radius * np.cos(turns), radius * np.sin(turns), np.zeros(count)])
