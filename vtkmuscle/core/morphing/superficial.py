"""A few fibres seen on a muscle's surface, and the direction that they give all of it.

Dissected, digitised or drawn fibres cover little of a surface, and may lie some way off it. What counts is
their direction there. Everywhere else it has to be inferred.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, eye_array
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from vtkmuscle.core.mesh.harmonic import (
    cotangent_laplacian,
    harmonic_extension,
    harmonic_field,
    triangle_gradients,
)
from vtkmuscle.core.mesh.normals import triangle_normals, unit_vectors, vertex_normals
from vtkmuscle.core.mesh.polylines import fibre_directions_at, proper_segments, segments
from vtkmuscle.core.mesh.surface import MeshTopology, extent
from vtkmuscle.core.types import Floats, Ints

Turns = NDArray[np.complex128]

#: Segments are cut in pieces of no more than this part of the extent of the muscle that they belong to.
LONGEST_PIECE = 0.02
#: By so much, as a part of the mean diagonal entry, each point is held at the muscle's course: a piece of the
#: surface without any given fibre would have no unique answer otherwise.
HOLD = 1e-9
#: Energies that differ by less than this part are equal.
SAME_ENERGY = 0.01


@dataclass(frozen=True, eq=False)
class SeenFibres:
    """Short pieces of the given fibres.

    Attributes
    ----------
    places : (m, 3) array
        Their middles [mm].
    directions : (m, 3) array
        Unit vectors along them; the sign means nothing.
    weights : (m,) array
        Their lengths [mm].
    """

    places: Floats
    directions: Floats
    weights: Floats

    def within(self, corner: Floats, frame: Floats) -> SeenFibres:
        """Return them in the coordinates along the columns of a frame (3, 3), from a corner (3,) on."""
        return replace(self, places=(self.places - corner) @ frame, directions=self.directions @ frame)


def seen_fibres(points: Floats, offsets: Ints, muscle: Floats) -> SeenFibres:
    """Return fibres in pieces.

    Parameters
    ----------
    points, offsets
        As of :func:`~vtkmuscle.core.fibres.arrangement.arrangement`.
    muscle : (m, 3) array
        Points of the muscle; no piece is longer than :data:`LONGEST_PIECE` of its extent [mm].

    Raises
    ------
    ValueError
        If no fibre has a length.
    """
    a, b, lengths = proper_segments(points, offsets)
    counts = np.maximum(np.ceil(lengths / (LONGEST_PIECE * extent(muscle))), 1).astype(np.int64)
    segment = np.repeat(np.arange(len(a)), counts)
    within = np.arange(len(segment)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = (within + 0.5) / counts[segment]
    step = b - a
    return SeenFibres(
        places=a[segment] + share[:, None] * step[segment],
        directions=(step / lengths[:, None])[segment],
        weights=(lengths / counts)[segment],
    )


def angle_to_nearest(seen: SeenFibres, points: Floats, offsets: Ints) -> float:
    """Return the angle between given fibres and the segments of others nearest to them [rad].

    Parameters
    ----------
    seen : SeenFibres
        The given ones.
    points, offsets
        Of the others, likewise.

    Returns
    -------
    float
        Root mean square, in [0, pi / 2].
    """
    a, b = segments(points, offsets)
    nearest = cKDTree((a + b) / 2.0).query(seen.places)[1]
    return root_mean_square(angle_between(seen.directions, (b - a)[nearest]), seen.weights)


def angle_between(directions: Floats, others: Floats) -> Floats:
    """Return the angles between lines, whatever their sign, (m,) [rad, 0 to pi / 2].

    Parameters
    ----------
    directions, others : (m, 3) arrays
        Of any length; the angle to a zero vector is pi / 2.
    """
    across = np.linalg.norm(np.cross(directions, others), axis=-1)
    along = np.abs((directions * others).sum(axis=-1))
    angles: Floats = np.where((across > 0.0) | (along > 0.0), np.arctan2(across, along), np.pi / 2.0)
    return angles


def root_mean_square(angles: Floats, weights: Floats) -> float:
    """Return the weighted root mean square of angles."""
    return float(np.sqrt((weights * angles**2).sum() / weights.sum()))


def directions_over_muscle(
    points: Floats, topology: MeshTopology, fixed_to: Ints, seen: SeenFibres
) -> Floats:
    """Return the direction of the fibres at each edge of a muscle of which a few fibres are known.

    Where nothing is known, the harmonic function between the muscle's ends gives a direction h. Where fibres
    are given, they deviate from it, by a turn about an axis across h. This turn is spread over the rest of
    the surface as smoothly as possible: the z_i that minimise sum_ij w_ij |z_j - R_ij z_i|^2, with w_ij the
    cotangent weights and R_ij the least rotation that takes h_i to h_j. So fibres keep their deviation from
    the muscle's course, also around a bend of it; next to a given fibre they run like that one, between two
    of them like both, and on the far side of a flat muscle as on the near one, straight through it. The
    nearest given fibre alone, as it is for fibres that fill a muscle, would make the direction jump half way
    between two of them, and be wrong beyond a bend. (A connection Laplacian as of Sharp, Soliman, Crane 2019,
    doi:10.1145/3243651, in the planes across h.)

    Parameters
    ----------
    points, topology, fixed_to
        As of :func:`~vtkmuscle.core.paths.lines.lines_on_surface`.
    seen : SeenFibres
        What is known; each piece counts at the point of the muscle nearest to it, its part across the surface
        left out.

    Returns
    -------
    (k, 3) array
        Unit directions along the surface, 0 between fixed points.
    """
    triangles, edges = topology.triangles, topology.edges
    field = harmonic_field(points, triangles, fixed_to)
    if field is None:
        # No ends, no course: all there is are the given fibres.
        ends = np.stack([seen.places - seen.directions, seen.places + seen.directions], axis=1)
        return fibre_directions_at(
            points[edges].mean(axis=1), ends.reshape(-1, 3), np.arange(0, 2 * len(ends) + 1, 2)
        )
    course = _course(points, triangles, field)
    normals = vertex_normals(points, triangles)
    nearest = cKDTree(points).query(seen.places)[1]
    first = np.cross(normals, course)
    upright = np.linalg.norm(first, axis=1) < 1e-6
    first[upright] = np.cross(np.eye(3)[np.abs(course[upright]).argmin(axis=1)], course[upright])
    first = unit_vectors(first)
    second = np.cross(course, first)
    known, values = _known_turns(seen, nearest, course, normals, first, second)
    laplacian = _without_ends(cotangent_laplacian(points, triangles), fixed_to >= 0)
    links = _least_rotations(laplacian, course, first, second)
    through, energy = _spread(laplacian, links, known, values)
    around, other = _spread(laplacian, np.ones_like(links), known, values)
    turns = around if other < (1.0 - SAME_ENERGY) * energy else through
    angles = np.abs(turns)[:, None]
    across = np.divide(turns, np.abs(turns), out=np.zeros_like(turns), where=np.abs(turns) > 0.0)
    towards = across.real[:, None] * first + across.imag[:, None] * second
    directions = np.cos(angles) * course + np.sin(angles) * towards
    # Those of both ends, along the triangles beside the edge.
    mean = directions[edges].sum(axis=1)
    mean[(fixed_to[edges] >= 0).all(axis=1)] = 0.0  # across the ends there is no course to compare with
    faces = np.vstack([unit_vectors(triangle_normals(points, triangles)), np.zeros(3)])  # -1: no triangle
    normal = unit_vectors(faces[topology.edge_triangles].sum(axis=1))
    return unit_vectors(mean - (mean * normal).sum(axis=1)[:, None] * normal)


def _without_ends(laplacian: csr_array, fixed: NDArray[np.bool_]) -> coo_array:
    """Return a Laplacian in which fixed points have free ones as neighbours only."""
    entries = coo_array(laplacian)
    i, j = entries.row, entries.col
    kept = (i != j) & ~(fixed[i] & fixed[j])
    i, j, weights = i[kept], j[kept], entries.data[kept]
    diagonal = np.arange(len(fixed))
    degrees = -np.bincount(i, weights, minlength=len(fixed))
    return coo_array((np.append(weights, degrees), (np.append(i, diagonal), np.append(j, diagonal))))


def _course(points: Floats, triangles: Ints, field: Floats) -> Floats:
    """Return the unit direction from end to end at each point; in the ends it goes on from around them."""
    gradients = triangle_gradients(points, triangles, field)
    lengths = np.linalg.norm(gradients, axis=1)
    steep = lengths > 1e-12 * lengths.max()
    sums = np.zeros_like(points)
    for corner in range(3):
        np.add.at(sums, triangles[steep, corner], gradients[steep] / lengths[steep, None])
    sizes = np.linalg.norm(sums, axis=1)
    known = np.flatnonzero(sizes > 1e-9)
    course = harmonic_extension(points, triangles, known, sums[known] / sizes[known, None])
    sizes = np.linalg.norm(course, axis=1)
    # Where means of opposite directions cancel, any direction will do.
    course[sizes <= 1e-9] = [0.0, 0.0, 1.0]
    return unit_vectors(course)


def _known_turns(
    seen: SeenFibres, nearest: Ints, course: Floats, normals: Floats, first: Floats, second: Floats
) -> tuple[Ints, Turns]:
    """Return the points next to given fibres, and how far these turn from the course, across it."""
    u, n, h = seen.directions, normals[nearest], course[nearest]
    along = unit_vectors(u - (u * n).sum(axis=1)[:, None] * n)
    flat = unit_vectors(h - (h * n).sum(axis=1)[:, None] * n)
    cosines = (along * flat).sum(axis=1)
    along[cosines < 0.0] *= -1.0
    aside = along - (along * h).sum(axis=1)[:, None] * h
    angles = np.arctan2(np.linalg.norm(aside, axis=1), (along * h).sum(axis=1))
    aside = unit_vectors(aside)
    turns = angles * ((aside * first[nearest]).sum(axis=1) + 1j * (aside * second[nearest]).sum(axis=1))
    # Pieces at right angles to the surface have no direction along it.
    weights = seen.weights * (np.linalg.norm(along, axis=1) > 0.0)
    known, number = np.unique(nearest, return_inverse=True)
    total = np.bincount(number, weights)
    aligned = total > 0.0
    values = np.zeros(len(known), dtype=np.complex128)
    values.real, values.imag = (np.bincount(number, weights * part) for part in (turns.real, turns.imag))
    return known[aligned], values[aligned] / total[aligned]


def _least_rotations(laplacian: coo_array, course: Floats, first: Floats, second: Floats) -> Turns:
    """Return for each entry (i, j) how the least rotation of h_j to h_i turns the planes across them."""
    i, j = laplacian.row, laplacian.col
    moved = _rotated(first[j], course[j], course[i])
    links = (moved * first[i]).sum(axis=1) + 1j * (moved * second[i]).sum(axis=1)
    pure: Turns = np.divide(links, np.abs(links), out=np.ones_like(links), where=np.abs(links) > 0.0)
    return pure


def _spread(
    laplacian: coo_array,
    links: Turns,
    known: Ints,
    values: Turns,
) -> tuple[Turns, float]:
    """Return turns (n,) that are known at some points and as smooth as can be elsewhere, and their energy."""
    n = laplacian.shape[0]
    system = coo_array((laplacian.data * links, (laplacian.row, laplacian.col)), (n, n)).tocsr()
    free = np.setdiff1d(np.arange(n), known)
    result = np.zeros(n, dtype=np.complex128)
    result[known] = values
    if len(free) and len(known):
        rows = system[free]
        inner = rows[:, free] + HOLD * system.diagonal().real.mean() * eye_array(len(free))
        # Positive definite: no pivoting, and an ordering for symmetric matrices.
        factors = splu(
            inner.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
        result[free] = factors.solve(-(rows[:, known] @ values))
    return result, float((result.conj() @ (system @ result)).real)


def _rotated(vectors: Floats, start: Floats, end: Floats) -> Floats:
    """Return vectors turned by the least rotation that takes unit vectors to others."""
    axis = np.cross(start, end)
    cosine = (start * end).sum(axis=1)[:, None]
    along = (axis * vectors).sum(axis=1)[:, None] * axis
    # Opposite directions have no least rotation: the half turn about any axis across is as good.
    factor = np.divide(1.0, 1.0 + cosine, out=np.zeros_like(cosine), where=cosine > -1.0 + 1e-9)
    turned: Floats = cosine * vectors + np.cross(axis, vectors) + factor * along
    return turned
