"""The options of a run, and the frames of a muscle, in memory or in files."""

import time
from collections import UserList
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Self

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.measures import mean_errors, segment_errors
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import remedy_for
from vtkmuscle.data.paths import levers_over_time, paths_of
from vtkmuscle.io.fibre_table import fibre_columns
from vtkmuscle.io.surfaces import read_own_polydata, read_polydata
from vtkmuscle.run.report_values import FIBRE_MEASURES

Progress = Callable[[str, str, float], None]
#: Frames to keep, in the words of a user.
FrameChoice = str | slice | range | int | None


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """The options of a run.

    Attributes
    ----------
    frames : str, slice, range, int or None
        Frames to keep and write, e.g. ``"0:10"`` for the first ten (the end is not included, as in Python);
        default all. The deformer ``"pbd"`` goes on from frame to frame, so earlier frames are computed too.
    workers : int or None
        Number of processes for solving muscles side by side and drawing figures; None: one per processor.
        Muscles that may meet, and a single muscle, are solved in this process. So are all muscles by default.
        The result does not depend on the number of processes.
    figures : bool
        Draw figures. Without OpenGL a warning is given and the remaining output is written.
    report : bool
        Write report.html: the scene to be turned and moved, curves, tables and verdicts, for a browser.
    overwrite : bool
        Whether results of a different scene in the folder, or files from outside of runs, may be replaced.
        The scene's own files are never replaced.
    fresh : bool
        Compute the folder's finished muscles again.
    sense : bool
        Check before the run whether the scene is plausible.
    progress : callable or None
        Called with the muscle's name, the stage, and the finished part, 0 to 1, before each stage and frame;
        from any thread.
    clock : callable
        Clock for the stages of muscles [s]; a function of a module, because all processes use the clock.

    Raises
    ------
    ValueError
        If an option is not allowed; the message names the allowed options.
    """

    frames: FrameChoice = None
    workers: int | None = 1
    figures: bool = True
    report: bool = True
    overwrite: bool = False
    fresh: bool = False
    sense: bool = True
    progress: Progress | None = None
    clock: Callable[[], float] = time.perf_counter

    def __post_init__(self) -> None:
        if self.workers is not None and (not hasattr(self.workers, "__index__") or self.workers < 1):
            raise InputError("", f"workers is {self.workers!r}, but must be an integer >= 1")
        for name in ("figures", "report", "overwrite", "fresh", "sense"):
            if (value := getattr(self, name)) not in (True, False):
                raise InputError("", f"{name} is {value!r}, but must be True or False")
        if self.progress is not None and not callable(self.progress):
            raise InputError("", f"progress is {self.progress!r}, not a function of muscle, stage, fraction")


def run_options(options: Mapping[str, Any], settings: Iterable[str] = ()) -> RunOptions:
    """Return options by name; an unknown name raises a TypeError, which names ``settings`` too."""
    own = [field.name for field in fields(RunOptions)]
    for key in sorted(options.keys() - own):
        raise TypeError(f"there is no option {key!r}; {remedy_for('RunOptions', key, [*own, *settings])}")
    return RunOptions(**options)


def frame_numbers(frames: FrameChoice, count: int) -> range:
    """Return the frame numbers selected from ``count`` frames.

    Ascending and not empty. ``frames`` is ``"A:B"`` or ``"A:B:STEP"`` as in Python (B is not included),
    ``"A"`` or an int for a single frame, a slice or range, or None for all. Invalid values raise a
    ValueError.

    Examples
    --------
    >>> from vtkmuscle.run import frame_numbers
    >>> frame_numbers("40:", 46)
    range(40, 46)
    """
    allowed = f"give A:B or A:B:STEP, 0 <= A < B <= {count} (B is not included), or a frame, 0 to {count - 1}"
    wanted = slice(None) if frames is None else frames
    try:
        if isinstance(wanted, str):
            bounds = [int(part) if part.strip() else None for part in wanted.split(":")]
            wanted = slice(*bounds) if len(bounds) > 1 else int(wanted)
        if isinstance(wanted, slice):
            wanted = range(*wanted.indices(count))
        numbers = wanted if isinstance(wanted, range) else range(wanted, wanted + 1)
    except (ValueError, TypeError):
        raise InputError("", f"frames {frames!r} cannot be understood", allowed) from None
    if not len(numbers) or numbers.step < 0 or numbers[0] < 0 or numbers[-1] >= count:
        raise InputError("", f"frames {frames!r}: the motion has {count} frames", allowed)
    return numbers


#: Field arrays of a written frame: its scene, the unit of length and the version of the package.
STAMPS = ("Scene", "Units", "Version")
#: Field array that VTK's writer adds to data that a pipeline made for a time.
TIME = "TimeValue"
#: What to do where files are missing or damaged.
RUN_AGAIN = "run the scene again: finished muscles are kept"


@dataclass(frozen=True, eq=False)
class WrittenFile:
    """A .vtp file in a run's folder, with its state when written or discovered.

    An ``own`` file was written by this run; another one may be damaged, and is read in a separate process.
    """

    path: Path
    state: tuple[int, ...]
    own: bool

    @classmethod
    def of(cls, path: Path, *, own: bool) -> Self:
        """Return a file in its present state."""
        return cls(path.absolute(), _state(path), own)

    def read(self) -> vtkPolyData:
        """Return the file's data without the run's stamps. Raises an InputError for a changed file."""
        if not self.path.is_file():
            raise InputError(self.path, "the file is missing", RUN_AGAIN)
        if _state(self.path) != self.state:
            raise InputError(self.path, "the file is not what the run has written", RUN_AGAIN)
        data = read_own_polydata(self.path) if self.own else read_polydata(self.path)
        for name in (*STAMPS, TIME):
            data.GetFieldData().RemoveArray(name)
        return data


def _state(path: Path) -> tuple[int, ...]:
    status = path.stat()
    return status.st_ino, status.st_size, status.st_mtime_ns


class Frames(UserList[Any]):
    """Frames of a surface or of fibres, as poly data or files. Files are read at every access."""

    def __getitem__(self, index: Any) -> Any:
        frame = super().__getitem__(index)
        return frame.read() if isinstance(frame, WrittenFile) else frame

    @property
    def files(self) -> list[WrittenFile]:
        """The files among the frames."""
        return [frame for frame in self.data if isinstance(frame, WrittenFile)]


#: Measures (k,) of the fibres in a frame, and levers (k,) of the paths by coordinate, None without paths.
FibreNumbers = tuple[dict[str, Floats], dict[str, Floats] | None]


def _numbers_of(fibres: vtkPolyData) -> FibreNumbers:
    paths = paths_of(fibres, "fibres")
    columns = {name: values for name, values in fibre_columns(fibres).items() if name in FIBRE_MEASURES}
    return columns, None if paths is None else paths.levers


@dataclass(eq=False)
class MuscleTrack:
    """The finished frames of one muscle.

    ``rest`` has the point array ``FixedTo``; ``surfaces`` are empty without a deformer, ``fibres`` where a
    muscle has none. Lengths of paths and of fibres are (k,) per frame [mm], ``rest_lengths`` (k,) those of
    paths at rest, ``segment_errors`` those of mean path lengths, ``bows`` means over the paths [mm]; a muscle
    on a single bone has no paths.
    ``report`` is the muscle's part of the report, JSON-able, and ``failure`` the frame and time of a failure,
    and the reason. ``arms`` keeps what a result has found by the coordinates that were asked for.
    """

    rest: Any = None
    rest_fibres: vtkPolyData | None = None
    surfaces: Frames = field(default_factory=Frames)
    fibres: Frames = field(default_factory=Frames)
    lengths: list[Floats] = field(default_factory=list)
    fibre_lengths: list[Floats] = field(default_factory=list)
    rest_lengths: Floats = field(default_factory=lambda: np.zeros(0))
    segment_errors: list[float] = field(default_factory=list)
    bows: list[dict[str, float]] = field(default_factory=list)
    report: dict[str, Any] = field(default_factory=dict)
    failure: tuple[int, float, Exception] | None = None
    arms: dict[tuple[str, ...], Any] = field(default_factory=dict)
    _numbers: list[FibreNumbers] = field(default_factory=list)

    @property
    def numbers(self) -> Sequence[FibreNumbers]:
        """The fibre numbers per frame. A run takes the numbers before writing the frame to a file."""
        if len(self._numbers) < len(self.fibres):
            self._numbers = [_numbers_of(fibres) for fibres in self.fibres]
        return self._numbers

    def levers(self) -> dict[str, Floats]:
        """Return the levers (f, k) of the paths by coordinate. NaN in frames with unknown levers."""
        return levers_over_time([levers for _, levers in self.numbers if levers is not None])

    @property
    def ratios(self) -> Floats:
        """Mean path lengths (f,) relative to rest; NaN with via rings: their means have no error."""
        unknown = np.nan if self.report.get("via_rings") else 1.0
        return np.asarray(unknown * np.mean(self.lengths, axis=1) / self.rest_lengths.mean())

    @property
    def sags(self) -> Floats:
        """Depths (f,) of the paths' straight segments in bones [mm], 0 without measured frames."""
        rows = self.report["frames"] or [{}] * len(self.lengths)
        return np.array([row.get("sag_p95_mm", 0.0) for row in rows])

    def errors(self) -> dict[str, Floats]:
        """Return the errors (f,) of the mean change of path length since rest [mm], and their parts."""
        if not self.lengths:
            return {}
        changes, bows = np.array(self.lengths) - self.rest_lengths, levers_over_time(self.bows)
        further = {"numerical": np.array(self.segment_errors), "bow": bows.get("", np.zeros(len(changes)))}
        return mean_errors(changes, self.ratios, **further)

    def add_lengths(self, fibres: vtkPolyData, millimetres: float) -> None:
        """Add the fibre and path lengths of a frame. The numbers of the fibres are added too."""
        self._numbers.append(_numbers_of(fibres))
        self.fibre_lengths.append(self._numbers[-1][0]["Length"] * millimetres)
        if (paths := paths_of(fibres, "fibres")) is not None:
            self.lengths.append(paths.lengths * millimetres)
            self.rest_lengths = paths.rest_lengths * millimetres
            self.segment_errors.append(float(segment_errors(paths.points).mean()) * millimetres)
            self.bows.append({name: float(bow.mean()) * millimetres for name, bow in paths.bows.items()})
