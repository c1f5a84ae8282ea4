"""Sensitivity: the spread of lengths and moment arms while landmarks, axes and surfaces are moved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats
from vtkmuscle.scenes import Scene
from vtkmuscle.studies.case import Case, Outcome
from vtkmuscle.studies.study import solutions
from vtkmuscle.studies.variation import CAUSES, FEWEST, samples_of


@dataclass(frozen=True, eq=False)
class Spread:
    """Standard deviations of a muscle's mean length and moment arms over samples of one cause.

    Attributes
    ----------
    lengths : (f,) array
        Of the paths' mean length in each frame [mm].
    moment_arms : dict of str to (m,) array
        By coordinate, of the paths' mean moment arm at each value [mm].
    values : dict of str to (m,) array
        By coordinate, its values in its unit.
    """

    lengths: Floats
    moment_arms: Mapping[str, Floats]
    values: Mapping[str, Floats]


def sensitivities(
    scene: Scene, *, samples: int = 8, seed: int = 0, **amounts: float
) -> dict[str, dict[str, Spread]]:
    """Return the spread of lengths and moment arms while inputs are moved at random, one cause at a time.

    The scene is run ``samples`` times for each cause, with its own model: ``replace(scene, model="paths")``
    takes a small part of the time. Studies of many subjects have the same as ``[sensitivity]``.

    Parameters
    ----------
    scene : Scene
        Muscles without fibres are left out.
    samples : int, optional
        Runs for each cause, 3 or more.
    seed : int, optional
        The same seed gives the same samples.
    **amounts : float
        How far each input is moved, ``landmarks=5.0`` for instance; see
        :class:`~vtkmuscle.studies.variation.Variation`.

    Returns
    -------
    dict of str to dict of str to Spread
        By muscle, then by cause, the cause with the largest spread of moment arms first.

    Raises
    ------
    ValueError
        If a cause is unknown, an amount is not positive, there are fewer than 3 samples, no muscle has
        fibres, or a sample cannot be run.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from vtkmuscle import Scene, phantoms, sensitivities
    >>> scene = replace(Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8), model="paths")
    >>> found = sensitivities(scene, samples=3, landmarks=2.0)
    >>> float(found["spindle"]["landmarks"].lengths.max()) < 2.0
    True
    """
    if samples < FEWEST:
        raise InputError("", f"samples is {samples!r}, but must be {FEWEST} or more")
    if not amounts:
        raise InputError("", "nothing is varied", f"give an amount of one or more of {', '.join(CAUSES)}")
    muscles = {name: muscle for name, muscle in scene.muscles.items() if muscle.fibres is not None}
    if not muscles:
        raise InputError("", "no muscle of the scene has fibres, so there are no lengths")
    alone = replace(scene, muscles=muscles, muscle_contact="off", files={})
    cases = {
        (name, cause): [
            Case({"sample": one.name}, name, alone, one) for one in samples_of(cause, amount, samples, seed)
        ]
        for cause, amount in amounts.items()
        for name in muscles
    }
    found: dict[str, dict[str, Spread]] = {name: {} for name in muscles}
    for (name, cause), outcomes in solutions(cases).items():
        if failures := [one.failure for one in outcomes if one.failure]:
            raise InputError("", f"{name}, {cause} moved about: {failures[0]}")
        if "lengths" in outcomes[0].values:  # a muscle on one bone has no paths
            found[name][cause] = _spread(outcomes)
    return {name: dict(sorted(causes.items(), key=_by_arms)) for name, causes in found.items()}


def _spread(outcomes: Sequence[Outcome]) -> Spread:
    lengths = [one.values["lengths"].mean(axis=1) for one in outcomes]
    arms = [one.arms for one in outcomes]
    first = arms[0]
    return Spread(
        np.std(lengths, axis=0, ddof=1),
        {name: np.std([one[name].mean for one in arms], axis=0, ddof=1) for name in first},
        {name: one.values for name, one in first.items()},
    )


def _by_arms(cause: tuple[str, Spread]) -> float:
    arms = cause[1].moment_arms.values()
    return -max((float(one.mean()) for one in arms), default=float(cause[1].lengths.mean()))
