"""Tables of results: columns of equal length by name."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from importlib import import_module
from itertools import chain, islice
from os import PathLike
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.measures import root_mean_square
from vtkmuscle.core.moment_arms.of_joints import JointArms
from vtkmuscle.core.motion.coordinates import ANGLES
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import MOST_LISTED, Remedies, suggestion
from vtkmuscle.data import toml_table
from vtkmuscle.data.anatomy import published_arm
from vtkmuscle.io.csv_table import write_rows
from vtkmuscle.io.writing import plain_cell

#: Columns of tables by name.
COLUMNS = toml_table("vtkmuscle.run", "measures.toml")["tables"]


class Table(Remedies, Mapping[str, NDArray[Any]]):
    """A table with columns by name.

    ``table["length_mm"]`` is a column, ``table.to_frame()`` the whole table for pandas.

    Parameters
    ----------
    columns : sequence of str
        Names of the columns.
    rows : iterable of sequence
        A value for each column; None, a missing value, is NaN in the column.

    Examples
    --------
    >>> from vtkmuscle import Table
    >>> table = Table(("muscle", "time", "length_mm"), [("iliacus", 0.0, 101.5), ("iliacus", 2.0, 99.0)])
    >>> table["length_mm"]
    array([101.5,  99. ])
    >>> table.where(muscle="iliacus", time=2.0)["length_mm"]
    array([99.])
    """

    def __init__(self, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
        listed = [[np.nan if value is None else value for value in row] for row in rows]
        self._names = tuple(columns)
        #: The columns of each part, the parts one below the other; joined where a column is asked for.
        self._parts = [tuple(_column([row[i] for row in listed]) for i in range(len(columns)))]

    @classmethod
    def stacked(cls, columns: Sequence[str], parts: Iterable[Mapping[str, Any]]) -> Self:
        """Return a table of parts, stacked in order.

        Parameters
        ----------
        columns : sequence of str
            Names of the columns.
        parts : iterable of mapping of str to array
            Per column the values, or a single value for all rows; arrays of a part are broadcast together,
            and read with the last index running fastest.

        Examples
        --------
        >>> from vtkmuscle import Table
        >>> Table.stacked(("fibre", "time"), [{"fibre": [[0], [1]], "time": [0.0, 2.0]}])["time"]
        array([0., 2., 0., 2.])
        """
        table = cls(columns, ())
        blocks = [tuple(np.broadcast_arrays(*(part[name] for name in columns))) for part in parts]
        table._parts = blocks or table._parts
        return table

    def __getitem__(self, column: str) -> NDArray[Any]:
        if column not in self._names:
            raise KeyError(f"the table has no column {column!r}; {suggestion(str(column), self)}")
        return np.concatenate([part[self._names.index(column)].ravel() for part in self._parts])

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __repr__(self) -> str:
        return f"Table: {self._count()} rows of {', '.join(self)}"

    def _repr_html_(self) -> str:
        rows = zip(*(column.tolist() for column in self.values()), strict=True)
        return html_table(tuple(self), rows) + escape(repr(self))

    def where(self, **wanted: Any) -> Self:
        """Return the rows with equal values in columns, as in ``table.where(muscle="iliacus", frame=10)``.

        Another column is a ValueError.
        """
        kept = np.ones(self._count(), dtype=np.bool_)
        for name, value in wanted.items():
            if name not in self:
                raise InputError("", f"the table has no column {name!r}", suggestion(name, self))
            column = self[name]
            floats = np.issubdtype(column.dtype, np.floating)
            equal = [each == value for each in column.tolist()]  # a vector is a value
            kept &= np.isclose(column, value, rtol=1e-9, atol=1e-9) if floats else equal
        return self.stacked(self._names, [{name: column[kept] for name, column in self.items()}])

    def to_csv(self, path: str | PathLike[str], *, digits: int | None = None) -> Path:
        """Write comma-separated values, and return the file.

        NaN is an empty cell.

        Parameters
        ----------
        path : path
            An existing file is replaced.
        digits : int, optional
            Digits of fractional numbers; None for as many as keep every bit.
        """
        columns = ([_cells(column.ravel(), digits) for column in part] for part in self._parts)
        rows = (zip(*cells, strict=True) for cells in columns)
        write_rows(Path(path), chain([map(plain_cell, self)], *rows))
        return Path(path)

    def to_frame(self) -> Any:
        """Return the table as a pandas DataFrame.

        ImportError without pandas; ``dict(table)`` works without.
        """
        return optional_package("pandas", "dict(table) gives arrays; a DataFrame").DataFrame(dict(self))

    def _count(self) -> int:
        return sum(part[0].size for part in self._parts if part)


class _ByCoordinate(dict[str, JointArms]):
    """Moment arms of a muscle by coordinate."""

    def __missing__(self, name: str) -> JointArms:
        raise KeyError(f"there are no moment arms by {name!r}; {suggestion(name, self)}")


class MomentArmTable(Remedies, dict[str, dict[str, JointArms]]):
    """Moment arms of muscles by coordinates, as in ``table["iliacus"]["hip_flexion_r"].mean``.

    Attributes
    ----------
    refused : dict of str to str
        Coordinates without moment arms, and the reasons.
    """

    def __init__(
        self, arms: Mapping[str, Mapping[str, JointArms]], refused: Mapping[str, str] | None = None,
        frames: Sequence[int] = (),
    ) -> None:  # fmt: skip
        super().__init__({muscle: _ByCoordinate(joints) for muscle, joints in arms.items()})
        self.refused = dict(refused or {})
        self._frames = np.array(frames)

    def __missing__(self, muscle: str) -> dict[str, JointArms]:
        raise KeyError(f"there are no moment arms of {muscle!r}; available: {', '.join(self) or 'none'}")

    def __repr__(self) -> str:
        lines = [f"  {at['muscle']}{repr(joint).removeprefix('JointArms')}" for at, joint in self.labelled()]
        title = "MomentArmTable [mm], mean (least to largest of all fibres and values):"
        return "\n".join([title, *lines] if lines else ["MomentArmTable: empty"])

    def table(self) -> Table:
        """Return the whole table, with the columns of moment_arms.csv. NaN without a quartic."""
        parts = (
            {
                **labels,
                "fibre": np.arange(joint.arms.shape[1])[:, None],
                "moment_arm_mm": joint.arms.T,
                "slope_mm": joint.slopes.T,
                "quartic_mm": np.nan if joint.quartic is None else joint.quartic.T,
            }
            for labels, joint in self.labelled()
        )
        return Table.stacked(COLUMNS["moment_arms"], parts)

    def summary(self) -> Table:
        """Return mean, range and error of the mean per muscle, coordinate and frame."""
        parts = (
            {
                **labels,
                "mean_mm": joint.mean,
                "slope_mean_mm": joint.mean_slope,
                "min_mm": joint.arms.min(axis=1),
                "max_mm": joint.arms.max(axis=1),
                "quartic_mean_mm": np.nan if joint.quartic is None else joint.quartic.mean(axis=1),
                "error_mm": joint.errors["total"],
            }
            for labels, joint in self.labelled()
        )
        return Table.stacked(COLUMNS["moment_arms_summary"], parts)

    def report(self, muscle: str, anatomical: str = "") -> dict[str, Any]:
        """Return range and mean of a muscle's moment arms, and published ones. By coordinate, JSON-able."""
        report = {}
        for name, joint in self.get(muscle, {}).items():
            ends = [float(joint.values.min()), float(joint.values.max())]
            own: dict[str, Any] = {"unit": joint.unit, "positive": joint.positive, "values": ends}
            own |= {f"{word}_mm": float(getattr(joint.arms, word)()) for word in ("mean", "min", "max")}
            own["errors"] = error_sizes(joint.errors)
            own["slope_difference_mm"] = root_mean_square(joint.arms - joint.slopes)
            residuals = joint.quartic_residuals
            own["quartic_residual_mean_mm"] = None if residuals is None else float(residuals.mean())
            arm = published_arm(anatomical, name, joint.positive) if joint.unit in ANGLES else None
            own["published"] = arm and arm._asdict()
            report[name] = own
        return report

    def labelled(self) -> Iterator[tuple[dict[str, Any], JointArms]]:
        """Give the columns that tables share, and the moment arms."""
        for muscle, joints in self.items():
            for name, joint in joints.items():
                of_rows = {"frame": self._frames[joint.frames], "value": joint.values}
                yield {"muscle": muscle, "coordinate": name, "unit": joint.unit, **of_rows}, joint


def optional_package(name: str, use: str, brought_by: str = "", file: Path | None = None) -> Any:
    """Return a module that is not installed with this package; ImportError where it is missing.

    ``brought_by`` is the package of a module of another name. With a ``file`` the error is an InputError.
    """
    try:
        return import_module(name)
    except ImportError as error:
        problem, remedy = f"{use} needs {brought_by or name}", f"python -m pip install {brought_by or name}"
        if file is not None:
            raise InputError(file, problem, remedy) from error
        raise ImportError(f"{problem}: {remedy}") from error


def error_sizes(errors: Mapping[str, Floats]) -> dict[str, float | None]:
    """Return root mean squares over the frames of an error and its parts."""
    return {f"{part}_mm": root_mean_square(values) for part, values in errors.items()}


def _column(values: list[Any]) -> NDArray[Any]:
    """Return values as an array (n,), vectors as objects."""
    vectors = any(isinstance(value, list | tuple) for value in values)
    return np.fromiter(values, object, len(values)) if vectors else np.array(values)


def _cells(column: NDArray[Any], digits: int | None) -> Iterable[Any]:
    """Return the written texts and numbers of a column."""
    values: list[Any] = column.tolist()
    if column.dtype.kind == "U":
        return map({text: plain_cell(text) for text in set(values)}.__getitem__, values)
    if column.dtype.kind != "f":
        return values
    written = map(repr if digits is None else f"%.{digits}g".__mod__, values)
    return ("" if text == "nan" else text for text in written) if np.isnan(column).any() else written


def html_table(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a table in HTML, of :data:`~vtkmuscle.core.words.MOST_LISTED` rows at most."""
    lines = []
    for tag, row in (("th", columns), *(("td", row) for row in islice(rows, MOST_LISTED))):
        texts = [f"{value:.6g}" if isinstance(value, float) else escape(str(value)) for value in row]
        lines.append("".join(f"<{tag}>{text}</{tag}>" for text in texts))
    return f"<table>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"
