"""What lengths and moment arms owe to their inputs: landmarks, axes and surfaces moved about."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from zlib import crc32

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.accuracy.variants import with_moved_areas
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.normals import vertex_normals
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.motion.rigid import RigidMotion, inverse, rotation_about
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.data.arrays import points_of, triangles_of, with_points
from vtkmuscle.scenes import Scene

#: What can be varied, and the unit of its amount.
CAUSES = {"landmarks": "mm", "axis": "deg", "centre": "mm", "segmentation": "mm"}

#: Fewest samples of which a standard deviation says anything.
_FEWEST = 3
#: Waves that a displacement of a surface is made of; length of the shortest, as a part of its diagonal.
_WAVES, _SHORTEST = 8, 0.25


@dataclass(frozen=True, eq=False)
class Spread:
    """Standard deviations of a muscle's mean length and moment arms over samples of one cause.

    Attributes
    ----------
    lengths : (f,) array
        Of the mean length of the paths in each frame [mm].
    moment_arms : dict of str to (m,) array
        By coordinate, of the paths' mean moment arm at each value [mm].
    values : dict of str to (m,) array
        The values of each coordinate, in its unit.
    """

    lengths: Floats
    moment_arms: Mapping[str, Floats]
    values: Mapping[str, Floats]


def varied(scene: Scene, cause: str, amount: float, *, sample: str, seed: int = 0) -> Scene:
    """Return a scene with one of its inputs moved about.

    Parameters
    ----------
    scene : Scene
        As it was measured.
    cause : str
        ``"landmarks"``: every area of every muscle as a whole, by ``amount`` [mm], in a direction of its own,
        all equally likely; via rings stay. ``"axis"``: the axes of the motion tilted by ``amount`` [degrees]
        about its centre, in any direction, all axes alike. ``"centre"``: the axes shifted by ``amount`` [mm],
        likewise. ``"segmentation"``: the points of each surface along their normals, by smooth waves whose
        standard deviation is ``amount`` [mm].
    amount : float
        By how much.
    sample : str
        Which sample; the same again for the same one. What happens to a bone or a muscle does not depend on
        which others there are.
    seed : int, optional
        Of all samples.

    Raises
    ------
    ValueError
        If there is no such cause, or the amount is not positive.
    """
    if cause not in CAUSES:
        raise InputError("", f"there is no cause {cause!r}", suggestion(cause, CAUSES))
    if not (np.isfinite(amount) and amount > 0.0):
        raise InputError("", f"{cause} is {amount!r}, but must be a positive number of {CAUSES[cause]}")

    def rng(name: str) -> np.random.Generator:
        return np.random.default_rng([seed, *(crc32(word.encode()) for word in (sample, name))])

    units = amount / scene.millimetres
    if cause == "axis":
        return replace(scene, motion=_moved(scene.motion, amount, 0.0, rng(cause)), files={})
    if cause == "centre":
        return replace(scene, motion=_moved(scene.motion, 0.0, units, rng(cause)), files={})
    muscles = scene.muscles.items()
    if cause == "landmarks":
        moved = {name: with_moved_areas(muscle, units, rng(f"muscle {name}")) for name, muscle in muscles}
        return replace(scene, muscles=moved, files={})
    return replace(
        scene,
        bones={name: _waved(bone, units, rng(f"bone {name}")) for name, bone in scene.bones.items()},
        muscles={
            name: replace(muscle, surface=_waved(muscle.surface, units, rng(f"muscle {name}")))
            for name, muscle in muscles
        },
        files={},
    )


def sensitivities(
    scene: Scene, *, samples: int = 8, seed: int = 0, **amounts: float
) -> dict[str, dict[str, Spread]]:
    """Return how lengths and moment arms change where inputs are moved about, one cause at a time.

    The scene is run ``samples`` times for each cause, with its own model: ``replace(scene, model="paths")``
    takes a small part of the time. Studies of many subjects have it as ``[sensitivity]``.

    Parameters
    ----------
    scene : Scene
        Muscles without fibres are left out.
    samples : int, optional
        Runs for each cause, 3 or more.
    seed : int, optional
        The same again for the same seed.
    **amounts : float
        By how much what is varied, ``landmarks=5.0`` for instance; see :func:`varied`.

    Returns
    -------
    dict of str to dict of str to Spread
        By muscle, then by cause, that with the largest spread of moment arms first.

    Raises
    ------
    ValueError
        If there is no such cause, an amount is not positive, there are fewer than 3 samples, or no muscle has
        fibres.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from vtkmuscle import Scene, phantoms, sensitivities
    >>> scene = replace(Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8), model="paths")
    >>> found = sensitivities(scene, samples=3, landmarks=2.0)
    >>> float(found["spindle"]["landmarks"].lengths.max()) < 2.0
    True
    """
    if samples < _FEWEST:
        raise InputError("", f"samples is {samples!r}, but must be {_FEWEST} or more")
    if not amounts:
        raise InputError("", "nothing is varied", f"give an amount of one or more of {', '.join(CAUSES)}")
    muscles = {name: muscle for name, muscle in scene.muscles.items() if muscle.fibres is not None}
    if not muscles:
        raise InputError("", "no muscle of the scene has fibres, so there are no lengths")
    alone = replace(scene, muscles=muscles, muscle_contact="off", files={})
    found: dict[str, dict[str, Spread]] = {name: {} for name in muscles}
    for cause, amount in amounts.items():
        for name, spread in _spreads(alone, cause, amount, samples, seed).items():
            found[name][cause] = spread
    return {name: dict(sorted(causes.items(), key=_by_arms)) for name, causes in found.items()}


def _by_arms(cause: tuple[str, Spread]) -> float:
    arms = cause[1].moment_arms.values()
    return -max((float(one.mean()) for one in arms), default=float(cause[1].lengths.mean()))


def _spreads(scene: Scene, cause: str, amount: float, samples: int, seed: int) -> dict[str, Spread]:
    """Return the spread of each muscle over the samples of one cause."""
    lengths: dict[str, list[Floats]] = {name: [] for name in scene.muscles}
    arms: dict[str, dict[str, list[Floats]]] = {name: {} for name in scene.muscles}
    values: dict[str, dict[str, Floats]] = {name: {} for name in scene.muscles}
    for number in range(samples):
        again = varied(scene, cause, amount, sample=f"{cause} {number + 1}", seed=seed)
        result = again.run(figures=False)
        table: Mapping[str, Mapping[str, JointArms]] = {}
        if result.motion.coordinates:
            table = result.moment_arms()
        for name, one in result.lengths.items():
            lengths[name].append(one.mean(axis=1))
            for coordinate, curve in table.get(name, {}).items():
                arms[name].setdefault(coordinate, []).append(curve.mean)
                values[name][coordinate] = curve.values
    return {
        name: Spread(
            np.std(lengths[name], axis=0, ddof=1),
            {coordinate: np.std(found, axis=0, ddof=1) for coordinate, found in arms[name].items()},
            values[name],
        )
        for name in scene.muscles
        if lengths[name]  # a muscle on one bone has no paths
    }


def _direction(rng: np.random.Generator) -> Floats:
    direction: Floats = rng.normal(size=3)
    return direction / np.linalg.norm(direction)


def _moved(motion: RigidMotion, angle: float, distance: float, rng: np.random.Generator) -> RigidMotion:
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
    waved: vtkPolyData = with_points(
        surface, points + deviation * np.sqrt(2.0 / _WAVES) * wave[:, None] * normals
    )
    return waved
