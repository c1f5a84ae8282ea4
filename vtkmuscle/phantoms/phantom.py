"""What a phantom is: bones, muscles, attachments and a motion, made by a rule, with known answers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import multiblock_from, surface_from
from vtkmuscle.data.attachments import AttachmentArea, attachments_from

#: A number, a function, or values by name.
Answer = float | Callable[..., float] | Mapping[str, NDArray[np.float64]]
Surface = tuple[NDArray[np.float64], NDArray[np.int64]]


@dataclass(frozen=True, eq=False)
class Phantom:
    """A scene made by a rule, in mm.

    Attributes
    ----------
    name : str
        What it is called.
    bones : vtkMultiBlockDataSet
        Named closed surfaces, in the rest pose.
    muscles : dict of str to vtkPolyData
        Closed surfaces, in the rest pose.
    attachments : dict of str to vtkMultiBlockDataSet
        Per muscle its areas, as filters take them.
    motion : RigidMotion
        Of the bones; its times are degrees, or numbers of frames where it has several coordinates.
    templates : dict of str to str
        Per muscle the kind of its fibre template.
    known : dict
        The answers: numbers, and functions, most of them of the angle [degrees]. Where the motion has several
        coordinates, ``known["coordinates"]`` has their values at each of its times, by name, and functions
        take them in that order.
    superficial : dict of str to vtkPolyData
        Per muscle fibres that are seen on its surface, where there are some.
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
    name: str,
    *,
    bones: Mapping[str, Surface],
    muscles: Mapping[str, Surface],
    areas: Mapping[str, Sequence[AttachmentArea]],
    motion: RigidMotion,
    templates: Mapping[str, str],
    known: Mapping[str, Answer],
    superficial: Mapping[str, vtkPolyData] | None = None,
) -> Phantom:
    """Return a phantom with VTK data sets of its own, from points and triangles."""
    return Phantom(
        name,
        multiblock_from({bone: surface_from(*surface) for bone, surface in bones.items()}),
        {muscle: surface_from(*surface) for muscle, surface in muscles.items()},
        {muscle: attachments_from(parts) for muscle, parts in areas.items()},
        motion,
        dict(templates),
        dict(known),
        dict(superficial or {}),
    )


def one_muscle(
    name: str,
    muscle: str,
    surface: Surface,
    areas: Sequence[AttachmentArea],
    *,
    bones: Mapping[str, Surface],
    motion: RigidMotion,
    known: Mapping[str, Answer],
    template: str = "parallel",
    superficial: vtkPolyData | None = None,
) -> Phantom:
    """Return a phantom of one muscle, as :func:`phantom_from` does."""
    return phantom_from(
        name,
        bones=bones,
        muscles={muscle: surface},
        areas={muscle: areas},
        motion=motion,
        templates={muscle: template},
        known=known,
        superficial=None if superficial is None else {muscle: superficial},
    )


def ends(
    origin: str, origin_ring: NDArray[np.float64], insertion: str, insertion_ring: NDArray[np.float64]
) -> list[AttachmentArea]:
    """Return the areas of both ends of a muscle: the bones, and rings of landmarks (k, 3) [mm]."""
    return [
        AttachmentArea("origin", origin, origin_ring, closed=True),
        AttachmentArea("insertion", insertion, insertion_ring, closed=True),
    ]


def round_ring(radius: float) -> Floats:
    """Return landmarks (12, 3) on a circle about the z axis, at z = 0 [mm]."""
    turns = 2.0 * np.pi * np.arange(12)[:, None] / 12
    ring: Floats = radius * (np.cos(turns) * [1.0, 0.0, 0.0] + np.sin(turns) * [0.0, 1.0, 0.0])
    return ring


def checked_poses(coordinates: ArrayLike, limits: Mapping[str, tuple[float, float]], phantom: str) -> Floats:
    """Return the angles of each frame, checked.

    Parameters
    ----------
    coordinates : (k, c) array_like
        A row per frame [degrees].
    limits : mapping of str to (low, high)
        Of each of the c coordinates, by name [degrees].
    phantom : str
        Named in errors.

    Returns
    -------
    (k, c) array
        The angles [degrees].

    Raises
    ------
    ValueError
        For another shape, or an angle out of range.
    """
    poses = np.array(coordinates, dtype=np.float64)
    where = f"{phantom}: coordinates"
    if poses.ndim != 2 or poses.shape[1] != len(limits) or not len(poses):
        raise InputError(where, f"of shape {poses.shape}", f"give a row per frame, of {' and '.join(limits)}")
    for column, (name, (low, high)) in enumerate(limits.items()):
        outside = poses[~((poses[:, column] >= low) & (poses[:, column] <= high)), column]
        if len(outside):
            raise InputError(
                where,
                f"{name} is {outside[0]:g} degrees, but answers are known from {low:g} to {high:g} only",
            )
    return poses
