"""Moment arms over the poses of a motion, coordinate by coordinate."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.polynomial.polynomial import polyder, polyfit, polyval
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.moment_arms.levers import SAME_VALUE, differences_by
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats, Ints

#: Degree of the polynomial that the field fits to lengths (Modenese, Kohout 2020), and how many different
#: values it needs: one more than coefficients, or it goes through every sample, noise and all.
QUARTIC = 4
FEWEST_FOR_QUARTIC = QUARTIC + 2


def checked_coordinates(motion: RigidMotion, names: Sequence[str]) -> None:
    """Raise a ValueError where a motion has no coordinate of one of the names."""
    for name in names:
        if name not in motion.coordinates:
            known = ", ".join(map(repr, motion.coordinates)) or "none"
            raise InputError("", f"the motion has no coordinate {name!r}", f"it has: {known}")


def known_coordinates(
    motion: RigidMotion, crossed: Sequence[str] | None = None, levers: Collection[str] = ()
) -> tuple[str, ...]:
    """Return the coordinates by which there may be moment arms.

    They change, or their joint or levers are known. ``crossed`` names the coordinates that lengths depend
    on, by default all. Raises a ValueError if there is none.
    """
    known = motion.coordinates
    among = known if crossed is None else crossed
    found = tuple(
        name for name, one in known.items() if name in among and (one.changes or one.twists or name in levers)
    )
    if not found:
        listed = ", ".join(map(repr, known)) or "none"
        raise InputError(
            "",
            f"no coordinate of the motion changes (it has: {listed}), so there are no moment arms",
            "name one that does, or use more frames of the motion",
        )
    return found


def joint_arms(
    lengths: ArrayLike,
    levers: Mapping[str, Floats],
    motion: RigidMotion,
    names: Sequence[str] | None = None,
    *,
    crossed: Sequence[str] | None = None,
    millimetres: float = 1.0,
) -> tuple[dict[str, JointArms], dict[str, str]]:
    """Return moment arms of paths by each coordinate of a motion, the others held.

    Parameters
    ----------
    lengths : (f, k) array_like
        Of the paths in each frame of the motion [mm].
    levers : mapping of str to (f, k) array
        Of the paths by the coordinates, NaN in frames in which they are not known; in the unit of the
        motion's translations.
    motion : RigidMotion
        With coordinates, and a time for each of the f frames.
    names : sequence of str, optional
        Wanted coordinates; default: all.
    crossed : sequence of str, optional
        Coordinates of the joints that the muscle crosses; default: all.
    millimetres : float, optional
        Of the unit of the motion's translations.

    Returns
    -------
    arms : dict of str to JointArms
        [mm, or 1 by a slide].
    refused : dict of str to str
        Why there are none by other coordinates.

    Raises
    ------
    ValueError
        If the motion has no such coordinate, or none by which there are moment arms.
    """
    checked_coordinates(motion, names or ())
    found = known_coordinates(motion, crossed, levers)
    curves = np.asarray(lengths, dtype=np.float64)
    arms: dict[str, JointArms] = {}
    refused: dict[str, str] = {}
    for name in found:
        if names is not None and name not in names:
            continue
        coordinate = motion.coordinates[name]
        known = levers.get(name, np.full(curves.shape, np.nan))
        frames = np.flatnonzero(np.isfinite(known).all(axis=1))
        if not len(frames):
            others = ", ".join(other for other in found if other != name) or "others"
            refused[name] = f"it changes only together with {others}, so what it moves alone is not known"
            continue
        quartic, residuals = _quartic(curves[frames], motion, found, name, frames)
        arms[name] = JointArms(
            name,
            coordinate.unit,
            coordinate.positive,
            frames,
            coordinate.values[frames],
            millimetres * known[frames],
            slopes_by(motion, name, found, curves)[frames],
            quartic,
            residuals,
        )
    if not arms and refused:
        raise InputError(
            "",
            "the coordinates change only together, so that it is not known what one of them moves alone",
            "use a motion that changes them one after the other, or a grid, or give the scene its joints",
        )
    return arms, refused


def slopes_by(motion: RigidMotion, name: str, among: Sequence[str], lengths: Floats) -> Floats:
    """Return -dl/dq (f, k) of lengths by differences between poses, NaN where no poses differ in it alone.

    Parameters as of :func:`~vtkmuscle.core.moment_arms.levers.differences_by`.
    """
    near = differences_by(motion, name, among)
    slopes = np.full(lengths.shape, np.nan)
    slopes[near.frames] = -near.slopes(lengths)
    return slopes


def _quartic(
    curves: Floats, motion: RigidMotion, found: Sequence[str], name: str, frames: Ints
) -> tuple[Floats | None, Floats | None]:
    """Return a quartic's arms (m, k) and residuals (k,), None where more than one coordinate changes."""
    if any(motion.coordinates[one].changes for one in found if one != name):
        return None, None
    try:
        return quartic_moment_arms(curves, motion.coordinates[name].natural[frames])
    except ValueError:  # too few values for it
        return None, None


def quartic_moment_arms(
    lengths: Floats, coordinate: Floats, *, at: Floats | None = None
) -> tuple[Floats, Floats]:
    """Return moment arms (m, k) by a polynomial of degree 4 through lengths, and its residuals (k,) (rms).

    It is the habit of the field (Modenese, Kohout 2020, doi:10.1007/s10439-020-02490-4), and smooth. Where a
    muscle lifts off a bone, or a curve has more than three bends, it is off, and the residual shows that.
    With fewer than 6 different values of the coordinate it raises a ValueError.

    Parameters
    ----------
    lengths : (f, k) array
        Of k fibres in f poses.
    coordinate : (f,) array
        Of the poses, in any order; in radians for an angle.
    at : (m,) array, optional
        Coordinates of the results; default: those of the poses.
    """
    low, high = coordinate.min(), coordinate.max()
    n_places = len(np.unique(np.round((coordinate - low) / max(SAME_VALUE * (high - low), 1e-300))))
    if n_places < FEWEST_FOR_QUARTIC:
        raise InputError(
            "",
            f"the coordinate has {n_places} different value(s), but a quartic needs {FEWEST_FOR_QUARTIC}",
            "use more frames of the motion",
        )
    places = coordinate if at is None else at
    q, wanted = (2.0 * (x - low) / (high - low) - 1.0 for x in (coordinate, places))
    fits = polyfit(q, lengths, QUARTIC)
    arms = -2.0 / (high - low) * polyval(wanted, polyder(fits)).T
    left = polyval(q, fits).T - lengths
    return arms, np.sqrt((left**2).mean(axis=0))
