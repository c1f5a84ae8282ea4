"""A muscle without its tendons: fascicles, their lengths and angles, by how thick it is along its course."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from vtkmuscle.core.fibres.measures import centroid_path, section_areas
from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.mesh.polylines import evenly_spaced, polyline_lengths
from vtkmuscle.core.types import Floats, Ints

#: Area of a muscle for the area of its tendon, at which both together are lightest (Ker, Alexander, Bennett
#: 1988, *Why are mammalian tendons so thick?*, Journal of Zoology 216, 309-324).
MUSCLE_FOR_TENDON = 34.0
#: A place counts as tendon below this part of the largest area along the muscle, half way from the muscle's
#: to the tendon's on a logarithmic scale; it may as well be a quarter of the way to either side.
TENDON_AREA = MUSCLE_FOR_TENDON**-0.5
TENDON_AREAS = (MUSCLE_FOR_TENDON**-0.75, MUSCLE_FOR_TENDON**-0.25)
#: Points of the medial curve, its degree, passes in which it is found, and places at which areas are known.
NODES, DEGREE, PASSES, PLACES = 17, 2, 8, 40
#: Points of a fibre that are looked up on the curve; part of a fascicle that its end's direction is of.
POINTS, END = 121, 0.1


@dataclass(frozen=True, eq=False)
class AreaProfile:
    """How thick a muscle is along its course.

    Attributes
    ----------
    curve : (c, 3) array
        Through the middle of it, from the origin to the insertion, beyond both [mm].
    arcs : (s,) array
        Places along the curve, the middles of even pieces of it [mm].
    areas : (s,) array
        Of its cross-sections there [mm^2].
    """

    curve: Floats
    arcs: Floats
    areas: Floats

    def muscle_between(self, share: float) -> tuple[float, float]:
        """Return the arcs between which it is more than a part of the largest area thick [mm]."""
        least = share * float(self.areas.max())
        thick = np.flatnonzero(self.areas >= least)
        half = (self.arcs[1] - self.arcs[0]) / 2.0
        return (
            self._crossing(int(thick[0]), -1, least, -half),
            self._crossing(int(thick[-1]), 1, least, half),
        )

    def volume_share(self, low: float, high: float) -> float:
        """Return the part of the volume that is between two arcs [mm]."""
        half = (self.arcs[1] - self.arcs[0]) / 2.0
        inside = np.minimum(self.arcs + half, high) - np.maximum(self.arcs - half, low)
        return float(np.clip(inside / (2.0 * half), 0.0, 1.0) @ self.areas / self.areas.sum())

    def _crossing(self, last: int, step: int, least: float, half: float) -> float:
        """Return where the area falls below the least beside the last place at which it does not."""
        if not 0 <= last + step < len(self.arcs):
            return float(self.arcs[last] + half)
        here, there = self.areas[last], self.areas[last + step]
        return float(self.arcs[last] + 2.0 * half * (here - least) / (here - there))


@dataclass(frozen=True, eq=False)
class Fascicles:
    """The muscle part of fibres, without tendon.

    Attributes
    ----------
    lengths : (k,) array
        Of each fascicle [mm]; 0 for a fibre that has no part in the muscle.
    origin_angles, insertion_angles : (k,) arrays
        Between the ends of the fascicles and the curve through the muscle's middle there [degrees].
    volume : float
        Of the muscle without its tendons [mm^3].
    """

    lengths: Floats
    origin_angles: Floats
    insertion_angles: Floats
    volume: float

    def cross_section(self, lengths: Floats | None = None) -> float:
        """Return the physiological cross-sectional area: volume cos(pennation) / fascicle length [mm^2].

        As of Lieber and Friden 2000, with the mean angle of both ends and the mean length, of these or
        of other ``lengths`` (k,) [mm].
        """
        angles = np.concatenate([self.origin_angles, self.insertion_angles])
        mean = float((self.lengths if lengths is None else lengths).mean())
        return self.volume * float(np.cos(np.radians(angles)).mean()) / mean if mean > 0.0 else 0.0


def area_profile(
    surface: Floats, triangles: Ints, samples: Floats, points: Floats, offsets: Ints
) -> AreaProfile:
    """Return how thick a muscle is along its course.

    The curve through its middle begins as the fibres' centroid path, and goes to the parabola
    that is nearest to the means of what is beside it (a curve of a higher degree curls in thick muscles;
    a principal curve: Hastie, Stuetzle 1989,
    doi:10.1080/01621459.1989.10478797): so a pennate muscle's runs along the muscle, across its fibres.

    Parameters
    ----------
    surface, triangles : (p, 3) array, (m, 3) int array
        Of the muscle [mm]: points, and their ids, closed, facing outward.
    samples : (j, 3) array
        Positions of even density in the muscle [mm].
    points, offsets : (n, 3) array, (k + 1,) int array
        Fibres from origin to insertion [mm]; first point of each, and n.
    """
    curve = centroid_path(points, offsets, NODES)
    for _ in range(PASSES):
        arcs, _ = along(curve, samples)
        places = np.linspace(arcs.min(), arcs.max(), NODES)
        curve = np.column_stack([Polynomial.fit(arcs, x, DEGREE)(places) for x in samples.T])
    arcs, _ = along(curve, surface)
    bounds = np.linspace(arcs.min(), arcs.max(), PLACES + 1)
    middles = (bounds[1:] + bounds[:-1]) / 2.0
    places, normals = _at(curve, middles)
    return AreaProfile(curve, middles, section_areas(surface, triangles, places, normals))


def along(curve: Floats, places: Floats) -> tuple[Floats, Floats]:
    """Return how far along a curve the points nearest to places are, and the curve's direction there.

    Parameters
    ----------
    curve : (c, 3) array
        A polyline, whose ends go on straight [mm].
    places : (n, 3) array
        Positions [mm].

    Returns
    -------
    arcs : (n,) array
        From the first point of the curve on, negative before it [mm].
    directions : (n, 3) array
        Unit vectors.
    """
    steps = np.diff(curve, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    ahead = unit_vectors(steps)
    begins = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
    nearest = np.full(len(places), np.inf)
    arcs, segment = np.zeros(len(places)), np.zeros(len(places), dtype=np.int64)
    for i, (start, way, length) in enumerate(zip(curve[:-1], ahead, lengths, strict=True)):
        low = -np.inf if i == 0 else 0.0
        high = np.inf if i == len(lengths) - 1 else length
        t = np.clip((places - start) @ way, low, high)
        square = ((places - start - t[:, None] * way) ** 2).sum(axis=1)
        better = square < nearest
        nearest[better], arcs[better], segment[better] = square[better], begins[i] + t[better], i
    return arcs, ahead[segment]


def _at(curve: Floats, arcs: Floats) -> tuple[Floats, Floats]:
    """Return places (n, 3) and directions (n, 3) of a curve at some arcs (n,), its ends going on straight."""
    steps = np.diff(curve, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    begins = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
    segment = np.clip(np.searchsorted(begins, arcs, side="right") - 1, 0, len(steps) - 1)
    ahead = unit_vectors(steps)[segment]
    return curve[segment] + (arcs - begins[segment])[:, None] * ahead, ahead


def fascicles(
    profile: AreaProfile, volume: float, points: Floats, offsets: Ints, *, share: float
) -> Fascicles:
    """Return the muscle part of fibres: the part of each where the muscle is thick enough.

    Parameters
    ----------
    profile : AreaProfile
        Of the muscle.
    volume : float
        Of the muscle [mm^3].
    points, offsets
        Fibres, as of :func:`area_profile`.
    share : float
        Part of the largest area, below which it is tendon.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.fibres.architecture import area_profile, fascicles
    >>> from vtkmuscle.phantoms.meshing import box
    >>> surface, triangles = box((-1.0, -1.0, 0.0), (1.0, 1.0, 20.0), 1.0)
    >>> samples = np.random.default_rng(0).uniform([-1.0, -1.0, 0.0], [1.0, 1.0, 20.0], (4000, 3))
    >>> fibres = np.array([[-0.5, 0.0, 0.0], [-0.5, 0.0, 20.0], [0.5, 0.0, 0.0], [0.5, 0.0, 20.0]])
    >>> profile = area_profile(surface, triangles, samples, fibres, np.array([0, 2, 4]))
    >>> found = fascicles(profile, 80.0, fibres, np.array([0, 2, 4]), share=0.17)
    >>> found.lengths.round(), round(found.cross_section())
    (array([20., 20.]), 4)
    """
    low, high = profile.muscle_between(share)
    dense = evenly_spaced(points, offsets, POINTS)
    arcs, directions = (
        found.reshape(len(dense), POINTS, -1) for found in along(profile.curve, dense.reshape(-1, 3))
    )
    within = (arcs[..., 0] >= low) & (arcs[..., 0] <= high)
    whole = polyline_lengths(points, offsets)
    # A piece of a fibre counts where its middle is in the muscle: by half where one end is.
    pieces = (within[:, 1:].astype(np.float64) + within[:, :-1]) / 2.0
    lengths = whole * pieces.mean(axis=1)
    angles = np.zeros((2, len(dense)))
    for i, inside in enumerate(within):
        places = np.flatnonzero(inside)
        if len(places) < 2:
            continue
        reach = max(1, round(END * len(places)))
        for side, (a, b) in enumerate(((places[0], places[0] + reach), (places[-1] - reach, places[-1]))):
            way, axis = dense[i, b] - dense[i, a], directions[i, (a + b) // 2]
            angles[side, i] = np.degrees(np.arctan2(np.linalg.norm(np.cross(way, axis)), abs(way @ axis)))
    return Fascicles(lengths, angles[0], angles[1], volume * profile.volume_share(low, high))
