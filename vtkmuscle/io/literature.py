"""Published moment arms, for comparison with a run."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import listed
from vtkmuscle.io.csv_table import finite_number, table_rows, write_rows

#: Required columns of a table; ``part`` is optional, further columns are ignored.
LITERATURE_COLUMNS = ("source", "muscle", "dof", "angle_deg", "moment_arm_mm")
#: Endings of parts for the two sides of a band.
LOWER, UPPER = "lower_bound", "upper_bound"


@dataclass(frozen=True, eq=False)
class LiteratureCurve:
    """Moment arms of a muscle by a coordinate, from a publication.

    ``dof`` is the coordinate, ``part`` a part of the muscle or kind of value, or "". ``angles`` (n,)
    [degrees] ascend; ``arms`` (n,) are moment arms -dl/dq [mm].
    """

    source: str
    muscle: str
    dof: str
    part: str
    angles: Floats
    arms: Floats


def read_literature(path: str | PathLike[str]) -> tuple[LiteratureCurve, ...]:
    """Read published moment arms from a CSV table.

    Parameters
    ----------
    path : path
        With the columns ``source``, ``muscle``, ``dof`` (the coordinate, e.g. ``hip_flexion``),
        ``angle_deg``, ``moment_arm_mm`` (-dl/dq, positive for a muscle that increases the coordinate),
        and optionally ``part``. Parts that end in ``lower_bound`` and ``upper_bound`` are the sides of a
        band. Further columns, empty lines and comments (#) are ignored.

    Returns
    -------
    tuple of LiteratureCurve
        A curve per source, muscle, coordinate and part, in the order of the table.

    Raises
    ------
    FileNotFoundError, ValueError
        If the file does not exist, a column is missing, a number is not finite or a name is empty; the
        message names the line.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import mkdtemp
    >>> from vtkmuscle.io import read_literature
    >>> table = Path(mkdtemp()) / "published.csv"
    >>> with table.open("w") as file:
    ...     print("source,muscle,dof,angle_deg,moment_arm_mm", file=file)
    ...     print("Somebody1985,psoas,hip_flexion,0,30", file=file)
    ...     print("Somebody1985,psoas,hip_flexion,9,31", file=file)
    >>> read_literature(table)[0].arms
    array([30., 31.])
    """
    path = Path(path)
    columns = ", ".join(LITERATURE_COLUMNS)
    remedy = f"published moment arms have the columns {columns}, and part for several curves of a source"
    curves: dict[tuple[str, str, str, str], list[tuple[float, float]]] = {}
    for line, row in table_rows(path, needed=LITERATURE_COLUMNS, remedy=remedy):
        if empty := [name for name in LITERATURE_COLUMNS if not row[name]]:
            raise InputError(path, f"line {line}: {empty[0]} is empty", "fill it in, or remove the line")
        key = (row["source"], row["muscle"], row["dof"], row.get("part", ""))
        angle, arm = (finite_number(row[name], name, path, f"line {line}") for name in LITERATURE_COLUMNS[3:])
        curves.setdefault(key, []).append((angle, arm))
    return tuple(LiteratureCurve(*key, *np.array(sorted(points)).T) for key, points in curves.items())


def write_literature(path: str | PathLike[str], curves: Sequence[LiteratureCurve]) -> None:
    """Write published moment arms as CSV for :func:`read_literature`."""
    rows: list[tuple[object, ...]] = [("source", "muscle", "dof", "part", "angle_deg", "moment_arm_mm")]
    for curve in curves:
        points = zip(curve.angles.tolist(), curve.arms.tolist(), strict=True)
        rows += [(curve.source, curve.muscle, curve.dof, curve.part, *point) for point in points]
    write_rows(Path(path), rows)


def curves_for(
    curves: Sequence[LiteratureCurve], *, muscle: str = "", coordinate: str = ""
) -> tuple[LiteratureCurve, ...]:
    """Return the curves of a muscle, a coordinate, or both, "" for any.

    Names are as in the scene; a side, ``_r`` or ``_l``, is optional in the curve's names.
    """
    muscles, axes = (("", name, side_apart(name)) for name in (muscle, coordinate))
    own = [curve for curve in curves if not muscle or curve.muscle in muscles]
    return tuple(curve for curve in own if not coordinate or curve.dof in axes)


def literature_of(
    path: Path, muscles: Sequence[str], coordinates: Sequence[str] | None = None
) -> dict[str, tuple[LiteratureCurve, ...]]:
    """Return the curves of muscles in a table. InputError without any, or any by the coordinates."""
    curves = read_literature(path)
    published = {name: own for name in muscles if (own := curves_for(curves, muscle=name))}
    if not published:
        theirs = f"muscles in the file: {', '.join(sorted({curve.muscle for curve in curves}))}"
        raise InputError(path, f"the file has no moment arms of {listed(muscles)}", theirs)
    every = [curve for own in published.values() for curve in own]
    if coordinates is not None and not any(curves_for(every, coordinate=name) for name in coordinates):
        theirs = f"dof in the file: {listed(sorted({curve.dof for curve in every}))}"
        raise InputError(path, f"the file has no moment arms by {listed(coordinates)}", theirs)
    return published


@dataclass(frozen=True, eq=False)
class DrawnCurve:
    """A line or a band in a figure. Angles (n,) [degrees] and arms (n,) [mm], up to ``upper`` (n,)."""

    source: str
    label: str
    angles: Floats
    arms: Floats
    upper: Floats | None = None


def drawn_curves(curves: Sequence[LiteratureCurve]) -> Iterator[DrawnCurve]:
    """Yield curves for a figure: bands, lines or points."""
    sides = [{_band(curve): curve for curve in curves if curve.part.endswith(end)} for end in (LOWER, UPPER)]
    for curve in curves:
        band = [side[_band(curve)] for side in sides if _band(curve) in side]
        grid = np.unique(np.concatenate([side.angles for side in band or [curve]]))
        for side in band:
            grid = grid[(side.angles[0] <= grid) & (grid <= side.angles[-1])]
        if len(band) < 2 or curve not in band or len(grid) < 2:  # sides at other angles enclose no area
            label = ", ".join(word.replace("_", " ") for word in (curve.source, curve.part) if word)
            yield DrawnCurve(curve.source, label, curve.angles, curve.arms)
        elif curve is band[0]:
            low, high = (np.interp(grid, side.angles, side.arms) for side in band)
            kind = _band(curve)[1].strip("_ ") or "fibres"
            yield DrawnCurve(curve.source, f"{curve.source}, {kind}", grid, low, high)


def _band(curve: LiteratureCurve) -> tuple[str, str]:
    """Return the source and part shared by both sides."""
    return curve.source, curve.part.removesuffix(LOWER).removesuffix(UPPER)


#: Words of the sides, by the endings of names.
_SIDES = {"_r": "right ", "_l": "left ", "_right": "right ", "_left": "left "}


def _ending(name: str) -> str:
    return next((ending for ending in _SIDES if name.casefold().endswith(ending)), "")


def side_apart(name: str) -> str:
    """Return a name without its side: ``iliacus`` for ``iliacus_r`` and ``iliacus_right``."""
    return name[: len(name) - len(_ending(name))]


def label_of(name: str, unit: str = "") -> str:
    """Return a name for readers: ``right hip flexion [degrees]`` for ``hip_flexion_r``."""
    in_brackets = {"deg": " [degrees]", "rad": " [radians]", "": ""}.get(unit, f" [{unit}]")
    return _SIDES.get(_ending(name), "") + side_apart(name).replace("_", " ") + in_brackets
