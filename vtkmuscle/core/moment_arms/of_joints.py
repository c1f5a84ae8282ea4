"""Moment arms over the poses of a motion, coordinate by coordinate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.moment_arms.derivatives import moment_arms, quartic_moment_arms
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.motion.sweeps import frames_of_sweep
from vtkmuscle.core.types import Bools, Floats


def coordinate_samples(
    motion: RigidMotion, crossed: Sequence[str] | None = None
) -> tuple[tuple[str, ...], Floats, Bools]:
    """Return what moment arms are taken by: coordinates, their values, and the frames that count.

    Parameters
    ----------
    motion : RigidMotion
        With coordinates.
    crossed : sequence of str, optional
        Those that lengths depend on; default: all, and what else moves the bones.

    Returns
    -------
    names : tuple of str
        The d coordinates that change.
    samples : (k, d) array
        In each frame [radians, or millimetres].
    used : (k,) bool array
        Of one coordinate the frames of its sweep, see :func:`~vtkmuscle.core.motion.sweeps.frames_of_sweep`;
        of several, or where it is known what lengths depend on, all of them.

    Raises
    ------
    ValueError
        If no coordinate changes.
    """
    known = motion.coordinates
    among = known if crossed is None else crossed
    found = tuple(name for name in known if known[name].changes and name in among)
    if not found:
        listed = ", ".join(map(repr, known)) or "none"
        raise InputError(
            "",
            f"no coordinate of the motion changes (it has: {listed}), so there are no moment arms",
            "name one that does, or use more frames of the motion",
        )
    samples = np.column_stack([known[name].natural for name in found])
    used = np.ones(len(samples), dtype=np.bool_)
    if crossed is None and len(found) == 1:
        used = frames_of_sweep(motion, found[0])
    return found, samples, used


def checked_coordinates(motion: RigidMotion, names: Sequence[str]) -> None:
    """Raise a ValueError where a motion has no coordinate of one of the names."""
    for name in names:
        if name not in motion.coordinates:
            known = ", ".join(map(repr, motion.coordinates)) or "none"
            raise InputError("", f"the motion has no coordinate {name!r}", f"it has: {known}")


def joint_arms(
    lengths: ArrayLike,
    motion: RigidMotion,
    names: Sequence[str] | None = None,
    *,
    crossed: Sequence[str] | None = None,
) -> tuple[dict[str, JointArms], dict[str, str]]:
    """Return moment arms by each coordinate of a motion, the others held.

    Parameters
    ----------
    lengths : (f, k) array_like
        Of the fibres in each frame of the motion [mm].
    motion : RigidMotion
        With coordinates, and a time for each of the f frames.
    names : sequence of str, optional
        Which of them are wanted; default: all. What the others change is taken into account in any case.
    crossed : sequence of str, optional
        Coordinates that the lengths depend on, those of the joints that the muscle crosses; default: all.

    Returns
    -------
    arms : dict of str to JointArms
        By those coordinates whose effects the poses separate.
    refused : dict of str to str
        Why there are none by the others.

    Raises
    ------
    ValueError
        If the motion has no such coordinate, or none by which moment arms are determined.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.moment_arms.of_joints import joint_arms
    >>> from vtkmuscle.core.motion.rigid import hinge
    >>> knee = hinge("tibia", (0, 0, 0), (1, 0, 0), np.arange(0.0, 91.0, 10.0), coordinate="knee")
    >>> arms, _ = joint_arms(300.0 - 0.5 * knee.times[:, None], knee)
    >>> arms["knee"].mean[:2].round(3)
    array([28.648, 28.648])
    """
    checked_coordinates(motion, names or ())
    found, samples, used = coordinate_samples(motion, crossed)
    curves = np.asarray(lengths, dtype=np.float64)[used]
    # The mean of the fibres is a curve like the others: so its error is that of the mean.
    fit = moment_arms(np.column_stack([curves, curves.mean(axis=1)]), samples[used])
    arms: dict[str, JointArms] = {}
    refused: dict[str, str] = {}
    for number, name in enumerate(found):
        at = fit.determined[:, number]
        if names is not None and name not in names:
            continue
        if not at.any():
            others = ", ".join(other for other in found if other != name)
            refused[name] = f"it changes only together with {others}, so that no slope by it alone is known"
            continue
        frames = np.flatnonzero(used)[at]
        quartic, residuals = _quartic(curves[at], samples[frames], number)
        arms[name] = JointArms(
            name,
            motion.coordinates[name].unit,
            motion.coordinates[name].positive,
            frames,
            motion.coordinates[name].values[frames],
            fit.arms[at, :-1, number],
            fit.errors[at, :-1, number],
            fit.arms[at, -1, number],
            fit.errors[at, -1, number],
            quartic,
            residuals,
            fit.window,
        )
    return arms, refused


def _quartic(curves: Floats, samples: Floats, number: int) -> tuple[Floats | None, Floats | None]:
    """Return a quartic's arms (m, k) and residuals (k,), None where more than one coordinate changes."""
    spreads = np.ptp(samples, axis=0)
    if (np.delete(spreads, number) > 1e-9 * spreads[number]).any():
        return None, None
    try:
        return quartic_moment_arms(curves, samples[:, number])
    except ValueError:  # too few values for it
        return None, None
