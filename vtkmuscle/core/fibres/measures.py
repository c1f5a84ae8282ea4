"""What researchers publish of fibres: curvature, lines of action, cross-sections, smoothed length curves."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from vtkmuscle.core.jit import array_kernel, kernel
from vtkmuscle.core.mesh.polylines import distance_between, resample_polyline, turn_at
from vtkmuscle.core.types import Bools, Floats, Ints


@array_kernel
def polyline_curvatures(points: Floats, offsets: Ints) -> tuple[Floats, Floats, Floats]:
    """Return the curvature of polylines: that of the circle through a point and its two neighbours.

    Parameters
    ----------
    points, offsets : (n, 3) array, (k + 1,) int array
        Positions [mm]; first point of each line, and n.

    Returns
    -------
    curvature : (n,) array
        At each point, 0 at ends and where neighbours coincide [1/mm].
    mean : (k,) array
        Of each line, weighted by the lengths of the segments at the points [1/mm].
    largest : (k,) array
        Of each line [1/mm].
    """
    curvature = np.zeros(len(points))
    mean, largest = np.zeros(len(offsets) - 1), np.zeros(len(offsets) - 1)
    for line in range(len(offsets) - 1):
        total = 0.0
        for i in range(offsets[line] + 1, offsets[line + 1] - 1):
            la, lb = distance_between(points, i, i - 1), distance_between(points, i + 1, i)
            sine, _ = turn_at(points, i)
            square = 0.0
            for axis in range(3):
                step = (points[i, axis] - points[i - 1, axis]) + (points[i + 1, axis] - points[i, axis])
                square += step * step
            chord = np.sqrt(square)
            total += la + lb
            if la > 0.0 and lb > 0.0 and chord > 0.0:
                # 4 area / product of the sides (Menger).
                curvature[i] = 2.0 * sine / (la * lb * chord)
            mean[line] += curvature[i] * (la + lb)
            largest[line] = max(largest[line], curvature[i])
        mean[line] = mean[line] / total if total > 0.0 else 0.0
    return curvature, mean, largest


def centroid_path(points: Floats, offsets: Ints, count: int) -> Floats:
    """Return the mean (count, 3) of all polylines at equal parts of their lengths, from start to end [mm].

    Parameters
    ----------
    points, offsets : (n, 3) array, (k + 1,) int array
        Positions [mm]; first point of each line, and n.
    count : int
        Points of the path, >= 2.
    """
    path = np.zeros((count, 3))
    for first, last in pairwise(offsets):
        line = points[first:last]
        length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
        path += resample_polyline(line, np.linspace(0.0, length, count))
    mean: Floats = path / (len(offsets) - 1)
    return mean


def line_of_action(points: Floats, offsets: Ints) -> Floats:
    """Return the unit vector (3,) from the mean start of polylines to their mean end; 0 if these coincide."""
    vector = points[offsets[1:] - 1].mean(axis=0) - points[offsets[:-1]].mean(axis=0)
    length = float(np.linalg.norm(vector))
    direction: Floats = vector / length if length > 0.0 else np.zeros(3)
    return direction


def angles_to(points: Floats, offsets: Ints, direction: Floats) -> Floats:
    """Return the angle between each polyline's chord and a direction (3,), (k,) [degrees, 0 to 180]."""
    chords = points[offsets[1:] - 1] - points[offsets[:-1]]
    across = np.linalg.norm(np.cross(chords, direction), axis=1)
    angles: Floats = np.degrees(np.arctan2(across, chords @ direction))
    return angles


@kernel
def _double_area_vector(points: Floats, triangle: Ints) -> tuple[float, float, float]:
    """Return the normal of a triangle (3,), as long as twice its area."""
    i, j, k = triangle[0], triangle[1], triangle[2]
    ax, ay, az = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
    bx, by, bz = points[k, 0] - points[i, 0], points[k, 1] - points[i, 1], points[k, 2] - points[i, 2]
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@array_kernel
def have_area(points: Floats, triangles: Ints) -> Bools:
    """Return which triangles (m, 3) between points (n, 3) have an area, (m,)."""
    result = np.empty(len(triangles), dtype=np.bool_)
    for t in range(len(triangles)):
        x, y, z = _double_area_vector(points, triangles[t])
        result[t] = x * x + y * y + z * z > 0.0
    return result


def physiological_cross_section(volume: float, lengths: Floats, angles: Floats) -> tuple[float, float]:
    """Return the physiological cross-sectional area, and its part along the line of action [mm^2].

    The area is volume / mean fibre length; what acts along the line of action is its product with the mean
    cosine of the fibres' angles to that line (Lieber, Friden 2000,
    doi:10.1002/1097-4598(200011)23:11<1647::AID-MUS1>3.0.CO;2-M).

    Parameters
    ----------
    volume : float
        Of the muscle [mm^3].
    lengths : (k,) array
        Of the fibres [mm]; their mean is not 0.
    angles : (k,) array
        Of the fibres to the line of action [degrees].
    """
    area = abs(volume) / float(lengths.mean())
    return area, area * float(np.cos(np.radians(angles)).mean())


def section_areas(points: Floats, triangles: Ints, places: Floats, normals: Floats) -> Floats:
    """Return the areas (s,) of plane sections of a closed surface [mm^2].

    Parameters
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        Positions [mm]; point ids, closed, facing outward.
    places, normals : (s, 3) arrays
        A point in each plane [mm] and its unit normal.
    """
    return np.array([_section_area(points, triangles, *plane) for plane in zip(places, normals, strict=True)])


@kernel
def _height(points: Floats, i: int, place: Floats, normal: Floats) -> float:
    """Return the signed distance of one of some points (n, 3) from a plane."""
    height = 0.0
    for axis in range(3):
        height += (points[i, axis] - place[axis]) * normal[axis]
    return height


@array_kernel
def _section_area(points: Floats, triangles: Ints, place: Floats, normal: Floats) -> float:
    """Return half the sum of n . (a x b) over the segments from a to b in which triangles meet the plane."""
    heights = np.zeros(len(points))
    for i in range(len(points)):
        heights[i] = _height(points, i, place, normal)
    ends = np.zeros((2, 3))
    double_area = 0.0
    for t in range(len(triangles)):
        n_ends = 0
        for corner in range(3):
            i, j = triangles[t, corner], triangles[t, (corner + 1) % 3]
            if (heights[i] < 0.0) != (heights[j] < 0.0):
                share = heights[i] / (heights[i] - heights[j])
                # The edge on which the triangle's boundary goes up comes last: so all loops run alike.
                at = 1 if heights[i] < 0.0 else 0
                for axis in range(3):
                    along = share * (points[j, axis] - points[i, axis])
                    ends[at, axis] = points[i, axis] + along - place[axis]
                n_ends += 1
        if n_ends == 2:
            for axis in range(3):
                one, two = (axis + 1) % 3, (axis + 2) % 3
                across = ends[0, one] * ends[1, two] - ends[0, two] * ends[1, one]
                double_area += across * normal[axis]
    area: float = abs(double_area) / 2.0
    return area


@kernel
def plane_crossings(points: Floats, offsets: Ints, place: Floats, normal: Floats) -> int:
    """Return how many polylines cross a plane, given by a point in it and its normal (3,)."""
    count = 0
    for line in range(len(offsets) - 1):
        below, above = False, False
        for i in range(offsets[line], offsets[line + 1]):
            height = _height(points, i, place, normal)
            below |= height < 0.0
            above |= height >= 0.0
        if below and above:
            count += 1
    return count


def smoothed_curve(values: Floats, *, passes: int = 5) -> Floats:
    """Return curves over time without their noise: l'_i = (l_{i-1} + 4 l_i + l_{i+1}) / 6, ends kept.

    Kohout, Cervenka 2021, section 4.4, doi:10.1007/978-3-030-72379-8_24: five passes.

    Parameters
    ----------
    values : (f,) or (f, k) array
        A row per frame, for instance fibre lengths [mm].
    passes : int, optional
        How often, >= 0.

    Returns
    -------
    array of the same shape
        Smoothed.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.fibres.measures import smoothed_curve
    >>> smoothed_curve(np.array([0.0, 6.0, 0.0]), passes=1)
    array([0., 4., 0.])
    """
    result: Floats = np.array(values, dtype=np.float64)
    for _ in range(passes if len(result) > 2 else 0):
        result[1:-1] = (result[:-2] + 4.0 * result[1:-1] + result[2:]) / 6.0
    return result
