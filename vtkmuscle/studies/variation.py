"""Variations of a scene: other settings, or one of its inputs moved at random."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, TypeVar
from zlib import crc32

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.normals import vertex_normals
from vtkmuscle.core.mesh.rest_shape import halved
from vtkmuscle.core.motion.rigid import RigidMotion, inverse, rotation_about
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.data.arrays import points_of, surface_from, triangles_of, with_points
from vtkmuscle.data.attachments import VIA
from vtkmuscle.scene.data import Muscle, SceneData

#: Inputs that can be moved at random, and the unit of the amount.
CAUSES = MappingProxyType({"landmarks": "mm", "axis": "deg", "centre": "mm", "segmentation": "mm"})

#: Fewest samples, or subjects, from which a standard deviation is computed.
FEWEST = 3

#: Number of waves in the displacement of a surface, and the shortest wavelength as a part of its diagonal.
_WAVES, _SHORTEST = 8, 0.25

_Scene = TypeVar("_Scene", bound=SceneData)


@dataclass(frozen=True)
class Variation:
    """A change of a scene. One with nothing but a name changes nothing.

    Attributes
    ----------
    name : str
        In tables, ``"mesh"`` or ``"landmarks 3"``. Random numbers of a sample are drawn by it.
    fibres : mapping
        Settings of the fibres, in place of those of the same names.
    model : str or None
        ``"volume"`` or ``"paths"``, in place of the scene's.
    halved : bool
        Halve the length of all edges of the muscles; their surfaces stay the same.
    cause : str
        One of :data:`CAUSES`. ``"landmarks"`` moves each area of each muscle as a whole, in a random
        direction of its own; via rings stay. ``"axis"`` tilts all axes of the motion alike about its centre,
        in a random direction; ``"centre"`` shifts them. ``"segmentation"`` moves the points of each surface
        along their normals by smooth waves.
    amount : float
        Of the movement, in the unit of the cause; of a segmentation the standard deviation.
    seed : int
        Of all samples. The change of a bone or a muscle does not depend on which others there are.

    Raises
    ------
    ValueError
        If the cause is unknown, or the amount is not positive.
    """

    name: str = ""
    fibres: Mapping[str, Any] = field(default_factory=dict)
    model: str | None = None
    halved: bool = False
    cause: str = ""
    amount: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.cause:
            return
        if self.cause not in CAUSES:
            raise InputError("", f"there is no cause {self.cause!r}", suggestion(self.cause, CAUSES))
        if not (np.isfinite(self.amount) and self.amount > 0.0):
            problem = (
                f"{self.cause} is {self.amount!r}, but must be a positive number of {CAUSES[self.cause]}"
            )
            raise InputError("", problem)

    def of(self, scene: _Scene) -> _Scene:
        """Return the scene with this change."""
        if self == Variation(self.name):
            return scene
        changed: dict[str, Any] = {"files": {}, "model": self.model or scene.model}
        changed["muscles"] = {name: self._of_muscle(name, one) for name, one in scene.muscles.items()}
        if self.cause:
            changed |= self._moved(scene, changed["muscles"])
        return replace(scene, **changed)

    def _of_muscle(self, name: str, muscle: Muscle) -> Muscle:
        changed: dict[str, Any] = {}
        if muscle.fibres is not None:
            changed["fibres"] = {**muscle.fibres, **self.fibres}
        if self.halved:
            points, triangles, _ = halved(points_of(muscle.surface), triangles_of(muscle.surface, name))
            changed["surface"] = surface_from(points, triangles)
        return replace(muscle, **changed)

    def _moved(self, scene: SceneData, muscles: Mapping[str, Muscle]) -> dict[str, Any]:
        """Return the fields of a scene that the cause changes."""
        units = self.amount / scene.millimetres
        if self.cause == "axis":
            return {"motion": _turned(scene.motion, self.amount, 0.0, self._rng(self.cause))}
        if self.cause == "centre":
            return {"motion": _turned(scene.motion, 0.0, units, self._rng(self.cause))}
        moved: dict[str, Muscle] = {}
        for name, one in muscles.items():
            rng = self._rng(f"muscle {name}")
            if self.cause == "landmarks":
                moved[name] = _with_moved_areas(one, units, rng)
            else:
                moved[name] = replace(one, surface=_waved(one.surface, units, rng))
        if self.cause == "landmarks":
            return {"muscles": moved}
        bones = {name: _waved(bone, units, self._rng(f"bone {name}")) for name, bone in scene.bones.items()}
        return {"bones": bones, "muscles": moved}

    def _rng(self, what: str) -> np.random.Generator:
        return np.random.default_rng([self.seed, *(crc32(word.encode()) for word in (self.name, what))])


#: The variation that changes nothing.
AS_IT_IS = Variation()


def samples_of(cause: str, amount: float, count: int, seed: int = 0, **more: Any) -> list[Variation]:
    """Return independent samples of one cause: ``"landmarks 1"`` and so on."""
    names = (f"{cause} {number + 1}" for number in range(count))
    return [Variation(name, cause=cause, amount=amount, seed=seed, **more) for name in names]


def _with_moved_areas(muscle: Muscle, distance: float, rng: np.random.Generator) -> Muscle:
    areas = []
    for area in muscle.attachments:
        landmarks = np.asarray(area.landmarks) + distance * _direction(rng)  # drawn for via rings too
        areas.append(area if area.role == VIA else replace(area, landmarks=landmarks))
    return replace(muscle, attachments=tuple(areas))


def _direction(rng: np.random.Generator) -> Floats:
    direction: Floats = rng.normal(size=3)
    return direction / np.linalg.norm(direction)


def _turned(motion: RigidMotion, angle: float, distance: float, rng: np.random.Generator) -> RigidMotion:
    """Return the motion about axes that are tilted by an angle [degrees] and shifted by a distance."""
    known = motion.centre
    centres = list(known.values()) if isinstance(known, Mapping) else [] if known is None else [known]
    centre = np.mean(centres, axis=0) if centres else np.zeros(3)
    tilt = rotation_about(centre, _direction(rng), angle) if angle else np.eye(4)
    tilt[:3, 3] += distance * _direction(rng)
    back = inverse(tilt)
    moved = {
        bone: np.array([tilt @ pose @ back for pose in table]) for bone, table in motion.transforms.items()
    }
    coordinates = {name: one.carried(tilt) for name, one in motion.coordinates.items()}
    return replace(motion, transforms=moved, coordinates=coordinates)


def _waved(surface: vtkPolyData, deviation: float, rng: np.random.Generator) -> vtkPolyData:
    """Return a surface with its points moved along their normals by smooth waves."""
    points = points_of(surface)
    normals = vertex_normals(points, triangles_of(surface, "surface"))
    size = max(float(np.linalg.norm(np.ptp(points, axis=0))), 1e-12)
    wave = np.zeros(len(points))
    for _ in range(_WAVES):
        length = size * rng.uniform(_SHORTEST, 1.0)
        wave += np.cos(2.0 * np.pi * (points @ _direction(rng)) / length + rng.uniform(0.0, 2.0 * np.pi))
    moved = points + deviation * np.sqrt(2.0 / _WAVES) * wave[:, None] * normals
    waved: vtkPolyData = with_points(surface, moved)
    return waved
