"""Read and write published moment arms, to draw beside those of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats
from vtkmuscle.io.csv_table import finite_number, table_rows, write_rows

#: Columns that a table must have; ``part`` is optional, others are ignored.
LITERATURE_COLUMNS = ("source", "muscle", "dof", "angle_deg", "moment_arm_mm")
#: Endings of parts that are the two sides of a band.
LOWER, UPPER = "lower_bound", "upper_bound"


@dataclass(frozen=True, eq=False)
class LiteratureCurve:
    """Moment arms of a muscle by a coordinate, from one source.

    Attributes
    ----------
    source, muscle, dof, part : str
        The publication, the muscle, the coordinate, and the part of the muscle or the kind of value; ``part``
        may be "".
    angles, arms : (n,) arrays
        Angles, ascending [degrees], and moment arms there [mm], -dl/dq.
    """

    source: str
    muscle: str
    dof: str
    part: str
    angles: Floats
    arms: Floats


def read_literature(path: str | PathLike[str]) -> tuple[LiteratureCurve, ...]:
    """Read published moment arms from a CSV table, one row per point of a curve.

    Parameters
    ----------
    path : path
        With the columns ``source``, ``muscle``, ``dof`` (the coordinate, e.g. ``hip_flexion``),
        ``angle_deg``, ``moment_arm_mm`` (-dl/dq: positive where the muscle drives the coordinate up), and
        optionally ``part``. Parts that end in ``lower_bound`` and ``upper_bound`` are the sides of a band.
        Other columns, empty lines and lines that begin with # are ignored.

    Returns
    -------
    tuple of LiteratureCurve
        One for each source, muscle, coordinate and part, in the order of the table.

    Raises
    ------
    FileNotFoundError, ValueError
        If there is no such file, a column is missing, a cell is no finite number or a name is empty; the
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
    remedy = f"published moment arms have the columns {', '.join(LITERATURE_COLUMNS)}, and part where "
    remedy += "there are several curves of one source"
    curves: dict[tuple[str, str, str, str], list[tuple[float, float]]] = {}
    for line, row in table_rows(path, needed=LITERATURE_COLUMNS, remedy=remedy):
        empty = [name for name in LITERATURE_COLUMNS if not row[name]]
        if empty:
            raise InputError(path, f"line {line}: {empty[0]} is empty", "fill it in, or leave the line out")
        key = (row["source"], row["muscle"], row["dof"], row.get("part", ""))
        point = (
            finite_number(row["angle_deg"], "angle_deg", path, f"line {line}"),
            finite_number(row["moment_arm_mm"], "moment_arm_mm", path, f"line {line}"),
        )
        curves.setdefault(key, []).append(point)
    return tuple(LiteratureCurve(*key, *np.array(sorted(points)).T) for key, points in curves.items())


def write_literature(path: str | PathLike[str], curves: Sequence[LiteratureCurve]) -> None:
    """Write published moment arms to a CSV file, so that :func:`read_literature` gives the same back."""
    rows = (
        (curve.source, curve.muscle, curve.dof, curve.part, *point)
        for curve in curves
        for point in zip(curve.angles.tolist(), curve.arms.tolist(), strict=True)
    )
    write_rows(Path(path), [("source", "muscle", "dof", "part", "angle_deg", "moment_arm_mm"), *rows])


def curves_for(
    curves: Sequence[LiteratureCurve], *, muscle: str = "", coordinate: str = ""
) -> tuple[LiteratureCurve, ...]:
    """Return the curves of a muscle, by a coordinate, or both.

    Names are those in the scene, "" for any; a side, ``_r`` or ``_l``, is ignored where the curve has none.
    """
    return tuple(
        curve
        for curve in curves
        if (not muscle or curve.muscle in (muscle, side_apart(muscle)))
        and (not coordinate or curve.dof in (coordinate, side_apart(coordinate)))
    )


@dataclass(frozen=True, eq=False)
class DrawnCurve:
    """A line or a band in a figure: ``upper`` (n,) is the upper side of a band, None of a line.

    ``angles`` (n,) [degrees] and ``arms`` (n,) [mm] are those of the line, or of the lower side of the band.
    """

    source: str
    label: str
    angles: Floats
    arms: Floats
    upper: Floats | None = None


def drawn(curves: Sequence[LiteratureCurve]) -> list[DrawnCurve]:
    """Return curves for a figure: bands where a source has two sides, else lines or single values."""
    uppers = {_sides(curve): curve for curve in curves if curve.part.endswith(UPPER)}
    lowers = {_sides(curve) for curve in curves if curve.part.endswith(LOWER)}
    found = []
    for one in curves:
        other = uppers.get(_sides(one))
        if one.part.endswith(LOWER) and other is not None:
            first, last = max(one.angles[0], other.angles[0]), min(one.angles[-1], other.angles[-1])
            grid = np.unique(np.concatenate([one.angles, other.angles]))
            grid = grid[(grid >= first) & (grid <= last)]
            low, high = (np.interp(grid, side.angles, side.arms) for side in (one, other))
            found.append(DrawnCurve(one.source, f"{one.source}, fibres", grid, low, high))
        elif not (one.part.endswith(UPPER) and _sides(one) in lowers):  # that is drawn with the other side
            label = ", ".join(word.replace("_", " ") for word in (one.source, one.part) if word)
            found.append(DrawnCurve(one.source, label, one.angles, one.arms))
    return found


def _sides(curve: LiteratureCurve) -> tuple[str, str]:
    """Return what the two sides of a band have in common."""
    return curve.source, curve.part.removesuffix(LOWER).removesuffix(UPPER)


def side_apart(name: str) -> str:
    """Return a name without its side: ``iliacus`` of ``iliacus_r``."""
    return name[:-2] if name[-2:].casefold() in ("_r", "_l") else name
