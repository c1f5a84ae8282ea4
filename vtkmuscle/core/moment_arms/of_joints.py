"""Moment arms over the poses of a motion, by coordinate."""

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyder, polyfit, polyval
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.measures import mean_errors
from vtkmuscle.core.moment_arms.levers import differences_by
from vtkmuscle.core.motion.coordinates import ANGLES
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import SAME, Floats, Ints

#: Degree of the polynomial fitted to lengths (Modenese, Kohout 2020).
QUARTIC = 4


def checked_coordinates(motion: RigidMotion, names: Sequence[str]) -> None:
    """Raise a ValueError for unknown coordinates of a motion."""
    for name in names:
        if name not in motion.coordinates:
            listed = ", ".join(map(repr, motion.coordinates)) or "none"
            raise InputError("", f"the motion has no coordinate {name!r}", f"it has: {listed}")


def known_coordinates(
    motion: RigidMotion, crossed: Sequence[str] | None = None, levers: Collection[str] = ()
) -> tuple[str, ...]:
    """Return the coordinates with possible moment arms.

    They change, or have a modelled joint or levers. ``crossed`` names the coordinates on which lengths
    depend, by default all. Raises a ValueError if there is none.
    """
    coordinates = motion.coordinates
    moving = [name for name, q in coordinates.items() if q.changes or q.twists or name in levers]
    names = tuple(name for name in moving if crossed is None or name in crossed)
    if not names:
        listed = ", ".join(map(repr, coordinates)) or "none"
        problem = f"no coordinate of the motion changes ({listed}), so there are no moment arms"
        raise InputError("", problem, "name a changing coordinate, or use more frames of the motion")
    return names


class ErrorSources(NamedTuple):
    """Sources of the errors of mean moment arms, for each frame (f,).

    ratios : mean lengths relative to rest; NaN where mean arms have no error;
    bows : by coordinate, parts of the mean levers that are of bows off the bones [mm];
    sags : depths of the paths' straight segments in the bones [mm].
    """

    ratios: Floats = np.array(np.nan)
    bows: Mapping[str, Floats] = MappingProxyType({})
    sags: Floats = np.array(0.0)


def joint_arms(
    lengths: ArrayLike, levers: Mapping[str, Floats], motion: RigidMotion, names: Sequence[str] | None = None,
    *, crossed: Sequence[str] | None = None, sources: ErrorSources | None = None,
) -> tuple[dict[str, "JointArms"], dict[str, str]]:  # fmt: skip
    """Return moment arms of paths by each coordinate.

    lengths : (f, k)_like, path lengths in each frame of the motion [mm];
    levers : mapping of str to (f, k), levers of the paths by the coordinates [mm, or without unit by a
        translation]; NaN in frames without levers;
    motion : RigidMotion, motion with coordinates, and a time for each of the f frames;
    names : sequence of str, wanted coordinates; default: all;
    crossed : sequence of str, coordinates of the joints that the muscle crosses; default: all;
    sources : ErrorSources, of the errors of mean arms; default: mean arms have no errors.

    Returns arms : dict of str to JointArms, moment arms [mm, or without unit by a translation];
    refused : dict of str to str, reasons for missing moment arms by further coordinates.

    Raises a ValueError if the motion lacks a named coordinate, or has no coordinate with moment arms.
    """
    checked_coordinates(motion, names or ())
    with_levers = [name for name, lever in levers.items() if np.isfinite(lever).any()]
    candidates = known_coordinates(motion, crossed, with_levers)
    curves, known = np.asarray(lengths, dtype=np.float64), sources or ErrorSources()
    arms: dict[str, JointArms] = {}
    refused: dict[str, str] = {}
    for name in candidates:
        if names is not None and name not in names:
            continue
        lever = levers.get(name, np.full(curves.shape, np.nan))
        frames = np.flatnonzero(np.isfinite(lever).all(axis=1))
        if not len(frames):
            rivals = ", ".join(rival for rival in candidates if rival != name) or "others"
            refused[name] = f"the coordinate changes only together with {rivals}"
            continue
        q, quartic, residuals = motion.coordinates[name], None, None
        if not any(motion.coordinates[other].changes for other in candidates if other != name):
            with suppress(ValueError):  # too few values for a quartic
                quartic, residuals = quartic_moment_arms(curves[frames], q.natural[frames])
        slopes = slopes_by(motion, name, candidates, curves, 2)[frames]
        of_mean, sag = (np.broadcast_to(x, len(curves))[frames] for x in (known.ratios, known.sags))
        bow = known.bows.get(name, np.zeros(len(curves)))[frames]
        by_frame = frames, q.values[frames], of_mean, bow, sag * (q.unit in ANGLES), lever[frames], slopes
        held = [motion.coordinates[other].values[frames] for other in candidates if other != name]
        fixed = np.round([q.values[frames] * 0.0, *held], 9)
        stretch = np.unique(fixed, axis=1, return_inverse=True)[1].ravel()
        # Most frames of a grid share a stretch; few frames of a walk do, such as the first and the last.
        shared = np.count_nonzero(np.bincount(stretch)[stretch] > 1)
        of_stretch = stretch if 2 * shared > len(frames) else None
        arms[name] = JointArms(name, q.unit, q.positive, *by_frame, quartic, residuals, of_stretch)
    if not arms and refused:
        problem = "the coordinates change only together, so there are no moment arms"
        remedy = "change the coordinates in turn or on a grid, or add joints to the scene"
        raise InputError("", problem, remedy)
    return arms, refused


def slopes_by(motion: RigidMotion, name: str, among: Sequence[str], lengths: Floats, least: int) -> Floats:
    """Return -dl/dq (f, k) of lengths, by differences between poses.

    NaN in frames with fewer than ``least`` neighbours, 1 or 2, that differ in the coordinate alone. Further
    parameters as for :func:`~vtkmuscle.core.moment_arms.levers.differences_by`.
    """
    differences = differences_by(motion, name, among)
    enough = np.count_nonzero(differences.weights, axis=1) >= least
    slopes = np.full(lengths.shape, np.nan)
    slopes[differences.frames[enough]] = -differences.slopes(lengths)[enough]
    return slopes


def quartic_moment_arms(
    lengths: Floats, coordinate: Floats, *, at: Floats | None = None
) -> tuple[Floats, Floats]:
    """Return moment arms (m, k) by quartics, and residuals (k,).

    The usual and smooth estimate (Modenese, Kohout 2020, doi:10.1007/s10439-020-02490-4). It fails for a
    muscle that lifts off a bone, or a curve with more than three bends, shown by the residual. Raises a
    ValueError for fewer than 6 different values of the coordinate.

    lengths : (f, k), lengths of k fibres in f poses;
    coordinate : (f,), value in each pose, in any order; in radians for an angle;
    at : (m,), coordinate values of the results; default: of the poses.
    """
    low, high = coordinate.min(), coordinate.max()
    count = len(np.unique(np.round((coordinate - low) / max(SAME * (high - low), 1e-300))))
    if count <= (coefficients := QUARTIC + 1):  # the polynomial would pass every noisy sample
        problem = f"the coordinate has {count} different value(s), but a quartic needs {coefficients + 1}"
        raise InputError("", problem, "use more frames of the motion")
    q, wanted = (2.0 * (x - low) / (high - low) - 1.0 for x in (coordinate, coordinate if at is None else at))
    fits = polyfit(q, lengths, QUARTIC)
    arms = -2.0 / (high - low) * polyval(wanted, polyder(fits)).T
    return arms, np.sqrt(((polyval(q, fits).T - lengths) ** 2).mean(axis=0))


@dataclass(frozen=True, eq=False, repr=False)
class JointArms:
    """Moment arms of a muscle's paths by a coordinate.

    Attributes
    ----------
    coordinate, unit, positive : str
        Name of the coordinate, its unit, and its positive direction.
    frames : (m,) int array
        Frames with moment arms, counted in the kept frames.
    values : (m,) array
        Coordinate values in the frames, in their unit.
    ratios : (m,) array
        Mean lengths of the paths relative to rest; NaN where mean arms have no error.
    bows : (m,) array
        Parts of the mean arms that are of bows off the bones.
    sags : (m,) array
        Depths of the paths' straight segments in the bones, for an angle; 0 for a translation.
    arms : (m, k) array
        Levers of the paths; positive if a pull increases the coordinate. In the unit of lengths for an angle,
        without unit for a translation.
    slopes : (m, k) array
        -dl/dq of the paths' lengths, by parabolas through frames that differ in this coordinate alone; NaN
        without three such frames. Slopes differ from arms by the error of a parabola between frames, and by
        errors of paths: jumps, or paths not at rest.
    quartic : (m, k) array or None
        Moment arms by a polynomial of degree 4 fitted to each path's lengths; None if other coordinates
        change, or for too few values.
    quartic_residuals : (k,) array or None
        Root mean square residuals of the polynomials.
    stretch : (m,) int array or None
        Number of the stretch of each frame: frames of a stretch differ in this coordinate alone. None if most
        frames are alone, as in a walk.
    """

    coordinate: str
    unit: str
    positive: str
    frames: Ints
    values: Floats
    ratios: Floats
    bows: Floats
    sags: Floats
    arms: Floats
    slopes: Floats
    quartic: Floats | None
    quartic_residuals: Floats | None
    stretch: Ints | None = None

    def __repr__(self) -> str:
        low, high = (f"{value:g}" for value in (self.values.min(), self.values.max()))
        arms, paths = self.arms, self.arms.shape[1]
        spread = f"{arms.mean():.1f} ({arms.min():.1f} to {arms.max():.1f}), {paths} paths"
        return f"JointArms by {self.coordinate}, {low} to {high} {self.unit}: {spread}"

    def drawn(self, rows: Floats) -> Floats:
        """Return rows of the frames (m, ...) as a curve: by stretch and value, with NaN between stretches.

        Without stretches the rows stay in order.
        """
        if self.stretch is None:
            return rows
        order = np.lexsort((self.values, self.stretch))
        return np.insert(rows[order], np.flatnonzero(np.diff(self.stretch[order])) + 1, np.nan, axis=0)

    @property
    def angles(self) -> Floats:
        """Values of the coordinate, of an angle in degrees."""
        return self.values * (ANGLES.get(self.unit, ANGLES["deg"]) / ANGLES["deg"])

    @property
    def mean(self) -> Floats:
        """Mean moment arm of all paths, (m,)."""
        return np.asarray(self.arms.mean(axis=1))

    @property
    def errors(self) -> dict[str, Floats]:
        """Error of the mean, ``total``, and its parts, (m,).

        ``numerical`` is the mean less the mean slope, and the sag: the lever of a straight segment is between
        the bone's and the bone's less the sag. See :func:`~vtkmuscle.core.fibres.measures.mean_errors`.
        """
        numerical = np.nan_to_num(np.abs(self.mean - self.mean_slope)) + np.nan_to_num(self.sags)
        return mean_errors(self.arms, self.ratios, numerical=numerical, bow=np.abs(self.bows))

    @property
    def mean_slope(self) -> Floats:
        """Mean slope of all paths, (m,); NaN if unknown."""
        return np.asarray(self.slopes.mean(axis=1))
