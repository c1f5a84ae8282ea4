"""Fibre templates: Bezier curves in the unit cube. A fibre has parameters (r, s) in [0, 1]^2.

The k-th control point of the fibre (r, s) lies on the k-th *sheet* of a template, a bilinear patch with
corners at (r, s) = (0, 0), (1, 0), (1, 1) and (0, 1). The first sheet is the origin area, the last sheet the
insertion area. Several parts of a template share the range of r equally. The kinds are written out in
:data:`TEMPLATES`:

``parallel``
    Straight fibres from the whole bottom (z = 0) to the whole top (z = 1).
``pennate``
    Straight, equally long, parallel fibres, oblique from the origin aponeurosis, the lower half of the face x
    = 0, to the insertion aponeurosis, the upper half of the face x = 1: from (0, s, r / 2) to (1, s, r / 2 +
    1 / 2). In a block of width w (x) and length l (z) fibres have the length sqrt(w^2 + (l / 2)^2), and the
    pennation angle atan(2 w / l) against the aponeuroses and the block's long axis. The areas lie side by
    side, so the line between them is no axis of the block.
``bipennate``
    Two pennate halves: from the lower half of the faces x = 0 (r < 1/2) and x = 1 to a tendon in the middle,
    the upper half of the plane x = 1 / 2. In a block the pennation angle is atan(w / l).
``curved``
    From the whole bottom to the whole top in arcs towards x = 1.
``fan``
    From the whole bottom to a narrow insertion area in the middle of the top.

A user's template is a small TOML or JSON file with the sheets from origin to insertion area::

    # A strap that bulges to the side: degree 2, three sheets.
    sheets = [
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],              # the origin area
        [[0.3, 0, 0.5], [1, 0, 0.5], [1, 1, 0.5], [0.3, 1, 0.5]],
        [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],              # the insertion area
    ]

A template of several parts is a list of tables ``[[parts]]``, each with ``sheets`` of equal degree.

References
----------
Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.1, extended in
doi:10.1007/978-3-642-38241-3_3; Blemker, Delp 2005, doi:10.1007/s10439-005-1433-7. Both show templates in
pictures only: the control points are this module's.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from math import comb
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import MOST_TEXT, InputError, check_is_file, fault_of
from vtkmuscle.core.mesh.sampling import sobol
from vtkmuscle.core.types import Floats

#: Degrees of the Bezier curves.
DEGREES = (2, 3, 4)

#: A range of coordinates, taken at parameter 0 and at parameter 1.
Range = tuple[float, float]


@dataclass(frozen=True, eq=False)
class FibreTemplate:
    """Fibres in the unit cube, as parts of control sheets.

    A part has corners (degree + 1, 4, 3). Part i of n has the fibres with i / n <= r < (i + 1) / n, and
    parametrises its sheets by (n r - i, s).
    """

    parts: tuple[Floats, ...]

    @property
    def origin_areas(self) -> Floats:
        """Corners of the parts' origin areas, (n, 4, 3)."""
        return np.array([sheets[0] for sheets in self.parts])

    @property
    def insertion_areas(self) -> Floats:
        """Corners of the parts' insertion areas, (n, 4, 3)."""
        return np.array([sheets[-1] for sheets in self.parts])

    def control_polygons(self, r: ArrayLike, s: ArrayLike) -> Floats:
        """Return the control points of fibres. Points (n, degree + 1, 3), parameters r, s (n,)."""
        n_parts = len(self.parts)
        along = np.asarray(r, dtype=np.float64) * n_parts
        part = np.minimum(along.astype(np.int64), n_parts - 1)
        u, v = along - part, np.asarray(s, dtype=np.float64)
        weights = np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v], axis=-1)
        return np.asarray(np.einsum("nc,nkcd->nkd", weights, np.array(self.parts)[part]))

    def fibres(self, r: ArrayLike, s: ArrayLike, t: ArrayLike) -> Floats:
        """Return points (n, m, 3) of fibres. They run from origin to insertion.

        Parameters r, s (n,) of the fibres and t (m,) of the points in [0, 1]; points are in the unit cube.
        """
        # Rounding must not lift a point out of the cube.
        return np.asarray(np.clip(bezier(self.control_polygons(r, s), t), 0.0, 1.0))


def bezier(polygons: Floats, t: ArrayLike) -> Floats:
    """Return points (n, m, 3) of Bezier curves.

    sum over k of C(d, k) (1 - t)^(d - k) t^k b_k for control points b (n, d + 1, 3) and parameters t (m,) in
    [0, 1].
    """
    degree = polygons.shape[1] - 1
    parameters = np.asarray(t, dtype=np.float64)
    basis = [comb(degree, k) * (1 - parameters) ** (degree - k) * parameters**k for k in range(degree + 1)]
    return np.asarray(np.einsum("km,nkd->nmd", np.array(basis), polygons))


def sobol_points(n: int) -> Floats:
    """Return evenly spread points (n, 2) inside the unit square.

    The first 2^m points of Sobol's sequence (Joe, Kuo 2008, doi:10.1137/070709359) have the multiples of
    2^-m, once each, as coordinates. A shift by half a cell keeps the first fibre off the cube's edge, which
    would lie in the muscle's surface.
    """
    exponent = max(n - 1, 0).bit_length()
    return np.asarray(sobol(n, 2) + 0.5 / 2**exponent)


def _level(z: float, *, x: Range = (0.0, 1.0), y: Range = (0.0, 1.0)) -> Floats:
    """Return a horizontal sheet. x runs with r, y with s."""
    return np.array([[x[0], y[0], z], [x[1], y[0], z], [x[1], y[1], z], [x[0], y[1], z]])


def _wall(x: float, *, z: Range) -> Floats:
    """Return an upright sheet across the cube. z runs with r, y with s."""
    return np.array([[x, 0.0, z[0]], [x, 0.0, z[1]], [x, 1.0, z[1]], [x, 1.0, z[0]]])


def _template(*parts: list[Floats]) -> FibreTemplate:
    return FibreTemplate(tuple(np.array(sheets) for sheets in parts))


#: The sheets of every kind, from the origin area to the insertion area.
TEMPLATES = {
    "parallel": _template([_level(0.0), _level(0.5), _level(1.0)]),
    "pennate": _template([_wall(0.0, z=(0.0, 0.5)), _wall(0.5, z=(0.25, 0.75)), _wall(1.0, z=(0.5, 1.0))]),
    "bipennate": _template(
        [_wall(0.0, z=(0.0, 0.5)), _wall(0.25, z=(0.25, 0.75)), _wall(0.5, z=(0.5, 1.0))],
        [_wall(1.0, z=(0.0, 0.5)), _wall(0.75, z=(0.25, 0.75)), _wall(0.5, z=(0.5, 1.0))],
    ),
    "curved": _template(
        [_level(z, x=(x, 1.0)) for z, x in ((0.0, 0.0), (0.25, 0.3), (0.5, 0.6), (0.75, 0.3), (1.0, 0.0))]
    ),
    "fan": _template(
        [
            _level(z, x=(x, 1 - x), y=(y, 1 - y))
            for z, x, y in ((0.0, 0.0, 0.0), (1 / 3, 0.05, 0.05), (2 / 3, 0.3, 0.2), (1.0, 0.35, 0.25))
        ]
    ),
}
KINDS = tuple(TEMPLATES)


def read_template(path: str | Path) -> FibreTemplate:
    """Return the template in a ``.toml`` or ``.json`` file.

    Raises a ValueError if the file cannot be read, is not TOML or JSON, or holds no template; the message
    names the key in the file and its allowed values.
    """
    file = Path(path)
    if file.suffix not in (".toml", ".json"):
        raise InputError("", f"the template {file} must be a .toml or a .json file")
    try:
        check_is_file(file, most=MOST_TEXT)
        text = file.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        problem, remedy = fault_of(error)
        raise InputError("", f"the template {file} cannot be read: {problem}", remedy) from error
    try:
        content = tomllib.loads(text) if file.suffix == ".toml" else json.loads(text)
    except (ValueError, RecursionError) as error:  # no TOML or JSON, an endless number, too many brackets
        kind = file.suffix[1:].upper()
        raise InputError("", f"the template {file} is not {kind}: {fault_of(error)[0]}") from error
    return template_from(content, file)


def template_from(content: Any, where: str | Path) -> FibreTemplate:
    """Return the template in the content of a file.

    The content is a mapping with ``sheets``, or with ``parts``, a list of mappings with ``sheets``. A
    ValueError names the wrong key.
    """
    parts = content.get("parts", [content]) if isinstance(content, Mapping) else None
    if not isinstance(parts, list) or not parts:
        raise InputError(where, "there must be the key 'sheets', or the key 'parts' with a list of tables")
    template = []
    for number, table in enumerate(parts):
        key = f"parts[{number}]" if "parts" in content else "the template"
        if not isinstance(table, Mapping) or set(table) != {"sheets"}:
            raise InputError(where, f"{key} must be a table with the single key 'sheets'")
        template.append(_sheets(table["sheets"], where, key))
        if len(template[-1]) != len(template[0]):
            problem = f"parts[{number}] has {len(template[-1])} sheets and parts[0] {len(template[0])}"
            raise InputError(where, problem, "all parts must have the same number")
    return FibreTemplate(tuple(template))


def _sheets(value: Any, where: str | Path, key: str) -> Floats:
    """Return control sheets (degree + 1, 4, 3)."""
    least, most = DEGREES[0] + 1, DEGREES[-1] + 1
    try:
        sheets = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):  # no numbers, or lists of different lengths
        sheets = np.empty(0)
    if sheets.ndim != 3 or sheets.shape[1:] != (4, 3) or not least <= len(sheets) <= most:
        problem = f"{key}: sheets must be a list of {least} to {most} sheets, for Bezier curves of degree"
        problem += f" {DEGREES[0]} to {DEGREES[-1]}, each of 4 corners with three numbers"
        raise InputError(where, problem, "the corners are at (r, s) = (0, 0), (1, 0), (1, 1), (0, 1)")
    if not ((sheets >= 0.0) & (sheets <= 1.0)).all():
        raise InputError(where, f"{key}: corners must be points of the unit cube, from 0 to 1")
    for i, name in ((0, "origin"), (-1, "insertion")):
        first, second = sheets[i, 2] - sheets[i, 0], sheets[i, 3] - sheets[i, 1]
        if not np.linalg.norm(np.cross(first, second)) > 0.0:
            raise InputError(where, f"{key}: the corners of the {name} area enclose no area")
    if np.array_equal(sheets[0], sheets[-1]):
        raise InputError(where, f"{key}: the origin area and the insertion area are the same")
    return sheets
