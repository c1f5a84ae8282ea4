"""What lengths and moment arms owe to where the landmarks are: the scene run again with them moved about."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.moment_arms.of_joints import JointArms
from vtkmuscle.core.types import Floats
from vtkmuscle.data.attachments import VIA
from vtkmuscle.scene.data import Muscle
from vtkmuscle.scenes import Scene

#: Fewest runs of which a standard deviation says anything.
_FEWEST = 3


@dataclass(frozen=True, eq=False)
class LandmarkError:
    """Standard deviations of a muscle's mean length and moment arms over runs with landmarks moved about.

    Attributes
    ----------
    lengths : (f,) array
        Of the mean length of the fibres in each frame [mm].
    moment_arms : dict of str to (m,) array
        By coordinate, of the fibres' mean moment arm at each value [mm].
    values : dict of str to (m,) array
        The values of each coordinate, in its unit.
    """

    lengths: Floats
    moment_arms: Mapping[str, Floats]
    values: Mapping[str, Floats]


def landmark_errors(
    scene: Scene, *, distance: float = 5.0, samples: int = 8, seed: int = 0
) -> dict[str, LandmarkError]:
    """Return how lengths and moment arms change where landmarks are moved about.

    Each run moves every area of every muscle as a whole, in a direction of its own, all equally likely; via
    rings stay. Fibres are made anew in each, and pulled taut (``model = "paths"``).

    Parameters
    ----------
    scene : Scene
        Muscles without fibres are left out.
    distance : float, optional
        By how much areas are moved [mm].
    samples : int, optional
        Runs, 3 or more.
    seed : int, optional
        Of the directions: the same for the same seed.

    Returns
    -------
    dict of str to LandmarkError
        By muscle.

    Raises
    ------
    ValueError
        If the distance is not positive, there are fewer than 3 runs, or no muscle has fibres.
    """
    if not (np.isfinite(distance) and distance > 0.0):
        raise InputError("", f"distance is {distance!r}, but must be a positive number of millimetres")
    if samples < _FEWEST:
        raise InputError("", f"samples is {samples!r}, but must be {_FEWEST} or more")
    muscles = {name: muscle for name, muscle in scene.muscles.items() if muscle.fibres is not None}
    if not muscles:
        raise InputError("", "no muscle of the scene has fibres, so there are no lengths")
    rng = np.random.default_rng(seed)
    lengths: dict[str, list[Floats]] = {name: [] for name in muscles}
    arms: dict[str, dict[str, list[Floats]]] = {name: {} for name in muscles}
    values: dict[str, dict[str, Floats]] = {name: {} for name in muscles}
    for _ in range(samples):
        moved = {name: _moved(muscle, distance / scene.millimetres, rng) for name, muscle in muscles.items()}
        again = replace(scene, muscles=moved, model="paths", muscle_contact="off", files={})
        result = again.run(figures=False)
        table: Mapping[str, Mapping[str, JointArms]] = {}
        if result.motion.coordinates:
            table = result.moment_arms()
        for name, found in result.lengths.items():
            lengths[name].append(found.mean(axis=1))
            for coordinate, one in table.get(name, {}).items():
                arms[name].setdefault(coordinate, []).append(one.mean)
                values[name][coordinate] = one.values
    return {
        name: LandmarkError(
            np.std(lengths[name], axis=0, ddof=1),
            {coordinate: np.std(found, axis=0, ddof=1) for coordinate, found in arms[name].items()},
            values[name],
        )
        for name in muscles
    }


def _moved(muscle: Muscle, distance: float, rng: np.random.Generator) -> Muscle:
    areas = []
    for area in muscle.attachments:
        direction = rng.normal(size=3)
        shift = distance * direction / np.linalg.norm(direction)
        areas.append(
            area if area.role == VIA else replace(area, landmarks=np.asarray(area.landmarks) + shift)
        )
    return replace(muscle, attachments=tuple(areas))
