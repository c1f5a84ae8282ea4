"""Smooth fibres without straightening the muscle: what they have in common stays as it is."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.mesh.polylines import smooth_polylines
from vtkmuscle.core.types import Floats, Ints


def smooth_about_course(points: Floats, offsets: Ints, k: float, passes: int) -> Floats:
    """Return fibres of which what differs from their common course is smoothed, end points kept.

    A three-point mean moves the points of a bend of radius R, h apart, inwards by h^2 / (R (k + 2)): each
    pass over fibres of 15 segments round a roller costs up to 2 mm. But what fibres have in common, the mean
    of their points, is the muscle's own course and no noise. So what the passes do to it is taken back.

    Parameters
    ----------
    points, offsets : (n, 3) array, (m + 1,) int array
        Positions [mm]; first point of each line, and n.
    k : float
        Weight of the middle point, >= 0.
    passes : int
        Number of passes, >= 0.

    Returns
    -------
    (n, 3) array
        New positions [mm]. Where there is one line, or lines differ in their numbers of points, there is no
        common course, and lines are smoothed as they are.

    References
    ----------
    Kohout et al. 2012, *Muscle Fibres Modelling*, section 3.4, has the passes, but no course.

    Examples
    --------
    Two fibres alike round a bend stay where they are:

    >>> import numpy as np
    >>> from vtkmuscle.core.fibres.course import smooth_about_course
    >>> turns = np.linspace(0.0, 1.5, 9)
    >>> bend = 20.0 * np.column_stack([np.cos(turns), np.sin(turns), 0.0 * turns])
    >>> fibres = np.vstack([bend, bend + [0.0, 0.0, 4.0]])
    >>> smoothed = smooth_about_course(fibres, np.array([0, 9, 18]), 4.0, 5)
    >>> bool(np.allclose(smoothed, fibres))
    True
    """
    smoothed: Floats = smooth_polylines(points, offsets, k, passes)
    counts = np.diff(offsets)
    if len(counts) < 2 or (counts != counts[0]).any():
        return smoothed
    course = points.reshape(len(counts), -1, 3).mean(axis=0)
    drawn_in = course - smooth_polylines(course, offsets[:2], k, passes)
    kept: Floats = smoothed + np.tile(drawn_in, (len(counts), 1))
    return kept
