"""Fibre templates: Bezier curves in the unit cube, one for each pair of parameters (r, s) in [0, 1]^2.

The k-th control point of the fibre (r, s) lies on the k-th of a template's *sheets*, bilinear patches that
are given by their corners at (r, s) = (0, 0), (1, 0), (1, 1) and (0, 1). The first sheet is the origin
area, the last one the insertion area. A template may consist of several parts, which share the range of r
equally. All kinds are written out in :data:`TEMPLATES`:

``parallel``
    Straight fibres from the whole bottom (z = 0) to the whole top (z = 1).
``pennate``
    Straight, equally long, parallel fibres that run obliquely from the origin aponeurosis, the lower half of
    the face x = 0, to the insertion aponeurosis, the upper half of the face x = 1: from (0, s, r / 2) to
    (1, s, r / 2 + 1 / 2). In a block of width w (x) and length l (z) the fibres' length is
    sqrt(w^2 + (l / 2)^2), and their pennation angle, against the aponeuroses and the block's long axis,
    atan(2 w / l). The areas lie beside each other, not above each other, so that the line from one to the
    other is no axis of the block.
``bipennate``
    Two pennate halves side by side: from the lower half of the faces x = 0 (r < 1/2) and x = 1 to a tendon
    in the middle, the upper half of the plane x = 1 / 2. In a block the pennation angle is atan(w / l).
``curved``
    From the whole bottom to the whole top in arcs that lean towards x = 1.
``fan``
    From the whole bottom to a narrow insertion area in the middle of the top.

References
----------
Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.1,
extended in doi:10.1007/978-3-642-38241-3_3; Blemker, Delp 2005, doi:10.1007/s10439-005-1433-7. Both show
templates in pictures only: the control points are this module's own.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.mesh.sampling import sobol
from vtkmuscle.core.types import Floats

#: A range of coordinates, taken at parameter 0 and at parameter 1.
Range = tuple[float, float]


@dataclass(frozen=True, eq=False)
class FibreTemplate:
    """Fibres in the unit cube.

    Attributes
    ----------
    parts : tuple of (degree + 1, 4, 3) float array
        Corners of the sheets of control points, from origin to insertion. Part i of n has the fibres with
        i / n <= r < (i + 1) / n, and its sheets are parametrised by (n r - i, s).
    """

    parts: tuple[Floats, ...]

    @property
    def origin_areas(self) -> Floats:
        """Corners of the origin area of each part, (n, 4, 3)."""
        return np.array([sheets[0] for sheets in self.parts])

    @property
    def insertion_areas(self) -> Floats:
        """Corners of the insertion area of each part, (n, 4, 3)."""
        return np.array([sheets[-1] for sheets in self.parts])

    def control_polygons(self, r: ArrayLike, s: ArrayLike) -> Floats:
        """Return the control points of fibres, (n, degree + 1, 3).

        Parameters
        ----------
        r, s : (n,) array_like
            Parameters in [0, 1].

        Returns
        -------
        (n, degree + 1, 3) array
            In the unit cube.
        """
        n_parts = len(self.parts)
        along = np.asarray(r, dtype=np.float64) * n_parts
        part = np.minimum(along.astype(np.int64), n_parts - 1)
        u, v = along - part, np.asarray(s, dtype=np.float64)
        weights = np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v], axis=-1)
        polygons: Floats = np.einsum("nc,nkcd->nkd", weights, np.array(self.parts)[part])
        return polygons

    def fibres(self, r: ArrayLike, s: ArrayLike, t: ArrayLike) -> Floats:
        """Return points of fibres.

        Parameters
        ----------
        r, s : (n,) array_like
            Parameters of the fibres, in [0, 1].
        t : (m,) array_like
            Parameters along them, 0 at the origin, 1 at the insertion.

        Returns
        -------
        (n, m, 3) array
            In the unit cube.
        """
        # Rounding must not lift a point out of the cube.
        points: Floats = np.clip(bezier(self.control_polygons(r, s), t), 0.0, 1.0)
        return points


def bezier(polygons: Floats, t: ArrayLike) -> Floats:
    """Return points of Bezier curves, sum over k of C(d, k) (1 - t)^(d - k) t^k b_k.

    Parameters
    ----------
    polygons : (n, d + 1, 3) array
        Control points of n curves of degree d.
    t : (m,) array_like
        Parameters in [0, 1].

    Returns
    -------
    (n, m, 3) array
        Points.
    """
    degree = polygons.shape[1] - 1
    parameters = np.asarray(t, dtype=np.float64)
    basis = [comb(degree, k) * (1 - parameters) ** (degree - k) * parameters**k for k in range(degree + 1)]
    points: Floats = np.einsum("km,nkd->nmd", np.array(basis), polygons)
    return points


def sobol_points(n: int) -> Floats:
    """Return n points that are evenly spread over the unit square, always the same ones.

    The first 2^m points of Sobol's sequence (Joe, Kuo 2008, doi:10.1137/070709359) divide the square evenly:
    their coordinates are the multiples of 2^-m, each once. They are moved by half of that, into the middle of
    their cells: otherwise the first fibre would be an edge of the cube, and lie in the muscle's surface.

    Parameters
    ----------
    n : int
        Number of points, >= 1; fastest spread where it is a power of two.

    Returns
    -------
    (n, 2) array
        Points strictly inside of the unit square.
    """
    exponent = max(n - 1, 0).bit_length()
    points: Floats = sobol(n, 2) + 0.5 / 2**exponent
    return points


def _level(z: float, *, x: Range = (0.0, 1.0), y: Range = (0.0, 1.0)) -> Floats:
    """Return a horizontal sheet: x runs with r, y with s."""
    return np.array([[x[0], y[0], z], [x[1], y[0], z], [x[1], y[1], z], [x[0], y[1], z]])


def _wall(x: float, *, z: Range) -> Floats:
    """Return an upright sheet across the cube: z runs with r, y with s."""
    return np.array([[x, 0.0, z[0]], [x, 0.0, z[1]], [x, 1.0, z[1]], [x, 1.0, z[0]]])


#: The sheets of every kind, from the origin area to the insertion area.
TEMPLATES = {
    "parallel": FibreTemplate((np.array([_level(0.0), _level(0.5), _level(1.0)]),)),
    "pennate": FibreTemplate(
        (np.array([_wall(0.0, z=(0.0, 0.5)), _wall(0.5, z=(0.25, 0.75)), _wall(1.0, z=(0.5, 1.0))]),)
    ),
    "bipennate": FibreTemplate(
        (
            np.array([_wall(0.0, z=(0.0, 0.5)), _wall(0.25, z=(0.25, 0.75)), _wall(0.5, z=(0.5, 1.0))]),
            np.array([_wall(1.0, z=(0.0, 0.5)), _wall(0.75, z=(0.25, 0.75)), _wall(0.5, z=(0.5, 1.0))]),
        )
    ),
    "curved": FibreTemplate(
        (
            np.array(
                [
                    _level(0.0),
                    _level(0.25, x=(0.3, 1.0)),
                    _level(0.5, x=(0.6, 1.0)),
                    _level(0.75, x=(0.3, 1.0)),
                    _level(1.0),
                ]
            ),
        )
    ),
    "fan": FibreTemplate(
        (
            np.array(
                [
                    _level(0.0),
                    _level(1 / 3, x=(0.05, 0.95), y=(0.05, 0.95)),
                    _level(2 / 3, x=(0.3, 0.7), y=(0.2, 0.8)),
                    _level(1.0, x=(0.35, 0.65), y=(0.25, 0.75)),
                ]
            ),
        )
    ),
}
KINDS = tuple(TEMPLATES)
