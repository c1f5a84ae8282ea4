"""The data of a run: surfaces, fibres and bones by frame or time, moment arms, and tables."""

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any, Self

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkMultiBlockDataSet

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.moment_arms.of_joints import ErrorSources, JointArms, joint_arms
from vtkmuscle.core.motion.coordinates import MILLIMETRES
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import ByName, suggestion
from vtkmuscle.data.arrays import blocks_of, multiblock_from, points_of, with_points
from vtkmuscle.data.paths import Paths, levers_over_time, paths_of
from vtkmuscle.filters.bone_motion import BoneMotion
from vtkmuscle.io.literature import LOWER, UPPER, LiteratureCurve, label_of, literature_of
from vtkmuscle.plotting.views import DrawnBones
from vtkmuscle.run.frames import MuscleTrack
from vtkmuscle.run.report_values import architecture_table, measures_of_fibres
from vtkmuscle.run.table import COLUMNS, MomentArmTable, Table, optional_package


class ResultData(ByName):
    """The frames and tables of a run; see :class:`vtkmuscle.Result` for its parameters."""

    def __init__(
        self, bones: vtkMultiBlockDataSet, motion: RigidMotion, tracks: Mapping[str, MuscleTrack],
        report: dict[str, Any], *, literature: Mapping[str, Sequence[LiteratureCurve]] | None = None,
        crosses: Mapping[str, Sequence[str]] | None = None, drawn_bones: DrawnBones | None = None,
    ) -> None:  # fmt: skip
        self.name: str = report["scene"]
        self.motion = motion
        self.time_label = time_label(motion)
        self.literature: Mapping[str, Sequence[LiteratureCurve]] = dict(literature or {})
        self.crosses: Mapping[str, Sequence[str]] = dict(crosses or {})
        self.units: str = report["units"]
        self.report: Mapping[str, Any] = report
        self.frames: Sequence[int] = list(report["frames"])
        self.times: Sequence[float] = [float(motion.times[frame]) for frame in self.frames]
        self.muscle_names: Sequence[str] = list(tracks)
        self._tracks = tracks
        self._bones = bones
        self.drawn_bones = drawn_bones or DrawnBones(bones)
        self._mover = BoneMotion(motion=motion)
        self._mover.connect(0, bones)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the parts for pickling: of a data set of many blocks its blocks."""
        more = {"literature": self.literature, "crosses": self.crosses, "drawn_bones": self.drawn_bones}
        return _made_of, (type(self), blocks_of(self._bones), (self.motion, self._tracks, self.report), more)

    @property
    def verdicts(self) -> Mapping[str, str]:
        """The verdict on each muscle."""
        muscles = {name: self.report["muscles"][name] for name in self.muscle_names}
        return {name: muscle["verdict"]["verdict"] for name, muscle in muscles.items() if "verdict" in muscle}

    @cached_property
    def lengths(self) -> Mapping[str, Floats]:
        """Per muscle the lengths of its paths in the finished frames, (frames, fibres) [mm]."""
        return _read_only({name: track.lengths for name, track in self._tracks.items()})

    @cached_property
    def fibre_lengths(self) -> Mapping[str, Floats]:
        """Per muscle those of its fibres, likewise."""
        return _read_only({name: track.fibre_lengths for name, track in self._tracks.items()})

    @property
    def has_moment_arms(self) -> bool:
        """Whether the run has found moment arms of any muscle."""
        return any(self.report["muscles"][name].get("moment_arms") for name in self.muscle_names)

    @property
    def all_arms(self) -> Mapping[str, Mapping[str, JointArms]]:
        """The moment arms by muscle and coordinate, empty where the run has none."""
        return self.moment_arms() if self.has_moment_arms else {}

    def finished(self, name: str) -> int:
        """Return the number of a muscle's kept frames. All, or those before a failure."""
        return len(self.report["muscles"][name]["frames"])

    def muscle(self, name: str, *, frame: int | None = None, time: float | None = None) -> Any:
        """Return a muscle in a kept frame, with the arrays it has at rest (``FixedTo`` and its own).

        Parameters
        ----------
        name : str
            Name of the muscle.
        frame, time : int, float, optional
            One of ``frames``, the number in the motion, or counted from the last as -1; or a time, of the
            nearest kept frame within half of the distance to the next.

        Raises
        ------
        ValueError
            If there is no such muscle or kept frame, the file of the frame is gone or changed, or the scene's
            deformer is ``"none"``.
        """
        i, track = self._position(frame, time), self.track(name)
        if self.report["deformer"] == "none":
            remedy = f"fibres({name!r}, frame={self.frames[i]}) has its fibres; deformer 'paths' deforms it"
            raise InputError("", f"the scene's deformer is 'none', so {name!r} was not deformed", remedy)
        self._check_finished(name, i)
        return _wrapped(with_points(track.rest, points_of(track.surfaces[i])))

    def fibres(self, name: str, *, frame: int | None = None, time: float | None = None) -> Any:
        """Return the fibres of a muscle in a kept frame. None where it has none; see :meth:`muscle`."""
        i, track = self._position(frame, time), self.track(name)
        if not track.fibres and track.rest_fibres is None:
            return None
        self._check_finished(name, i)
        return _wrapped(track.fibres[i])

    def paths(self, name: str, *, frame: int | None = None, time: float | None = None) -> Paths:
        """Return the paths of a muscle in a kept frame, in the scene's unit; see :meth:`muscle`.

        Returns
        -------
        Paths
            Their ``lengths`` (k,), ``points`` (k, n, 3), and ``levers``: per coordinate the moment arms (k,).
        """
        i, track = self._position(frame, time), self.track(name)
        paths = paths_of(self.fibres(name, frame=self.frames[i]), name) if track.lengths else None
        if paths is None:
            raise InputError("", f"{name!r} has no paths", "give the muscle fibres, and areas on two bones")
        return paths

    def bones(self, *, frame: int | None = None, time: float | None = None) -> Any:
        """Return the bones in a kept frame, a block each, with the field array ``Transform``."""
        return _wrapped(self._mover.update(time=self.times[self._position(frame, time)]).output)

    def rest_muscle(self, name: str) -> Any:
        """Return a muscle at rest, with the point array ``FixedTo``."""
        return _wrapped(self.track(name).rest)

    def rest_fibres(self, name: str) -> Any:
        """Return the fibres of a muscle at rest, None where it has none."""
        return _wrapped(self.track(name).rest_fibres)

    def rest_bones(self) -> Any:
        """Return the bones at rest."""
        return _wrapped(self._bones)

    def track(self, name: str) -> MuscleTrack:
        """Return the frames and numbers of a muscle."""
        if name not in self.muscle_names:
            named = suggestion(name, self._tracks) if isinstance(name, str) else "give a muscle's name"
            raise InputError("", f"there is no muscle {name!r} in the result", named)
        return self._tracks[name]

    def _position(self, frame: int | None, time: float | None) -> int:
        """Return the position of a frame, given by number or time, among the kept frames."""
        if (frame is None) == (time is None):
            raise InputError("", "give either the number of a frame (frame=10) or the time (time=20.0)")
        if frame is not None:
            if -len(self.frames) <= frame < 0:
                return len(self.frames) + frame
            if frame not in self.frames:
                raise InputError("", f"frame {frame} was not kept", _listed(self.frames))
            return self.frames.index(frame)
        away = np.abs(np.array(self.times) - float(time))  # type: ignore[arg-type]
        nearest = int(np.argmin(away))
        steps = np.abs(np.diff(self.times))[max(nearest - 1, 0) : nearest + 1]
        if not away[nearest] <= max(0.5 * steps.max(initial=0.0), 1e-9 * abs(self.times[nearest])):
            raise InputError("", f"no frame of time {time:g} was kept", _listed(self.times))
        return nearest

    def _check_finished(self, name: str, i: int) -> None:
        if i >= self.finished(name):
            remedy = f"{self.finished(name)} of {len(self.frames)} frames are there"
            raise InputError("", f"{name!r} failed before frame {self.frames[i]}", remedy)

    def moment_arms(self, *coordinates: str) -> MomentArmTable:
        """Return the moment arms of all paths in the kept frames: the levers of their pulls.

        Parameters
        ----------
        *coordinates : str
            Names of coordinates of the motion; default: all that change, or whose joint is known.

        Returns
        -------
        MomentArmTable
            Per muscle and coordinate arms, -dl/dq beside them and a quartic fit [mm], see
            :class:`~vtkmuscle.core.moment_arms.of_joints.JointArms`; ``table()`` gives a table.

        Raises
        ------
        ValueError
            If no muscle has fibres, the motion has no such coordinate or none that changes, or the
            coordinates change together only, and their joints are not known.
        """
        if not self.lengths:
            remedy = "give the muscles fibres; with deformer 'pbd' set paths too"
            raise InputError("", "no muscle of the run has paths, so no moment arms", remedy)
        motion = self.motion.part(self.frames)
        among, wanted = coordinates or tuple(motion.coordinates), coordinates or None
        every = self.motion.coordinates
        useful = {name for name in among if name in every and (every[name].changes or every[name].twists)}
        arms: dict[str, dict[str, JointArms]] = {}
        refused: dict[str, str] = {}
        problems: list[InputError] = []
        for name, lengths in self.lengths.items():
            crossed = self.crosses.get(name)
            if len(lengths) < len(self.frames) or (crossed is not None and useful.isdisjoint(crossed)):
                continue
            try:
                track = self.track(name)
                if coordinates not in track.arms:
                    levers, bows = track.levers(), levers_over_time(track.bows)
                    levers = {name: MILLIMETRES[self.units] * lever for name, lever in levers.items()}
                    sources = ErrorSources(track.ratios, bows, track.sags)
                    options: dict[str, Any] = {"crossed": crossed, "sources": sources}
                    track.arms[coordinates] = joint_arms(lengths, levers, motion, wanted, **options)
                arms[name], without = track.arms[coordinates]
            except InputError as error:  # of this muscle alone, where others cross other coordinates
                problems.append(error)
                without = dict.fromkeys(crossed or among, str(error))
            refused |= without
        if problems and not arms:
            raise problems[0]
        return MomentArmTable(arms, refused, self.frames)

    def length_table(self) -> Table:
        """Return the lengths of the paths, a row per muscle, fibre and frame, as lengths.csv."""
        return self._lengths("lengths", self.lengths)

    def fibre_length_table(self) -> Table:
        """Return the lengths of the fibres, a row per muscle, fibre and frame, as fibre_lengths.csv."""
        return self._lengths("fibre_lengths", self.fibre_lengths)

    def pose_table(self) -> Table:
        """Return the values of the coordinates. A row per frame of the motion, as poses.csv."""
        columns = {"frame": np.arange(len(self.motion.times)), "time": self.motion.times}
        own = self.motion.coordinates.items()
        columns |= {f"coordinate {name}" if name in columns else name: q.values for name, q in own}
        return Table.stacked(tuple(columns), [columns])

    def _lengths(self, table: str, lengths: Mapping[str, Floats]) -> Table:
        """Return a table of lengths (f, k) per muscle [mm]. In the first f frames, with errors of means."""
        parts = (
            {
                "muscle": name,
                "fibre": np.arange(values.shape[1])[:, None],
                "frame": self.frames[: len(values)],
                "time": self.times[: len(values)],
                "length_mm": values.T,
                "mean_error_mm": self._tracks[name].errors().get("total", np.nan),
            }
            for name, values in lengths.items()
        )
        return Table.stacked(COLUMNS[table], parts)

    def frame_table(self) -> Table:
        """Return the numbers of the report. A row per muscle and frame; NaN where a muscle has none.

        ``report["definitions"]`` says what they are; the measures of fibres are in the report alone.
        """
        muscles = self.report["muscles"]
        rows = [{"muscle": name, **row} for name in self.muscle_names for row in muscles[name]["frames"]]
        numbers = (key for row in rows for key, value in row.items() if not isinstance(value, dict | list))
        columns = dict.fromkeys(numbers)
        return Table(tuple(columns), ([row.get(key) for key in columns] for row in rows))

    def architecture(self) -> Table:
        """Return the architecture of the muscles at rest, a row each, as architecture.csv."""
        return architecture_table(self.report["muscles"])

    def tables(self) -> dict[str, Table]:
        """Return the tables that a run writes, by their names: lengths, moment arms, poses, architecture."""
        tables = {"lengths": self.length_table(), "fibre_lengths": self.fibre_length_table()}
        if self.has_moment_arms:
            arms = self.moment_arms()
            tables |= {"moment_arms": arms.table(), "moment_arms_summary": arms.summary()}
        if self.motion.coordinates:
            tables["poses"] = self.pose_table()
        return tables | {"architecture": self.architecture()}

    def fibre_tables(self) -> Iterator[tuple[str, Table]]:
        """Give the measures of the fibres of each muscle. A row per fibre and frame."""
        for name, track in self._tracks.items():
            if track.fibres:
                measures = [measures_of_fibres(own, MILLIMETRES[self.units]) for own, _ in track.numbers]
                ids = {"fibre": np.arange(len(measures[0]["length_mm"]))}
                parts = (ids | {"time": t} | own for t, own in zip(self.times, measures, strict=False))
                yield name, Table.stacked(("fibre", "time", *measures[0]), parts)

    def to_csv(self, folder: str | PathLike[str]) -> list[Path]:
        """Write the tables of the result to a folder, and return the .csv files.

        Lengths, moment arms, poses, architecture, and the checks by frame. The folder is made where it does
        not exist; files of the same names are replaced.
        """
        tables = self.tables() | {"frames": self.frame_table()}
        return [table.to_csv(Path(folder) / f"{name}.csv") for name, table in tables.items()]

    def to_frame(self) -> Any:
        """Return ``length_table()`` as a pandas DataFrame, or raise an ImportError without pandas."""
        return self.length_table().to_frame()

    def to_xarray(self) -> Any:
        """Return lengths and moment arms as an xarray Dataset.

        ``length_mm`` and ``fibre_length_mm`` are over (muscle, fibre, frame), ``moment_arm_mm`` over
        (muscle, coordinate, fibre, frame), NaN where a muscle has no value; ``time`` and the values of each
        coordinate, by its name, are over frame. Raises an ImportError without xarray.

        Examples
        --------
        >>> from vtkmuscle import Scene, phantoms
        >>> scene = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8)
        >>> data = scene.run(frames="0:3").to_xarray()  # doctest: +SKIP
        >>> data["moment_arm_mm"].sel(muscle="spindle").mean("fibre").plot()  # doctest: +SKIP
        """
        xarray = optional_package("xarray", "a Dataset")
        tables = {"length_mm": self.length_table(), "fibre_length_mm": self.fibre_length_table()}
        axes = ("muscle", "coordinate", "fibre", "frame")
        if self.has_moment_arms:
            tables["moment_arm_mm"] = self.moment_arms().table()
        data = xarray.Dataset()
        for name, table in tables.items():
            cube = table.to_frame().set_index([axis for axis in axes if axis in table])
            data = data.merge({name: cube[name.removeprefix("fibre_")].to_xarray()}, join="outer")
        poses, kept = self.pose_table(), data["frame"].values.astype(np.int64)
        own = {name: ("frame", column[kept]) for name, column in poses.items() if name not in axes}
        return data.assign_coords(own)

    def published_arms(self, muscle: str) -> tuple[LiteratureCurve, ...]:
        """Return the published curves of a muscle's moment arms to draw.

        Those of the scene, and bands of the ranges that the package knows, by the name of the muscle.
        """
        curves = [*self.literature.get(muscle, ())]
        for name, own in self.report["muscles"][muscle].get("moment_arms", {}).items():
            angles = self.all_arms[muscle][name].angles
            if (known := own.get("published")) is not None:
                ends = np.clip(known["values"], angles.min(), angles.max())
                for part, arm in ((f"range {LOWER}", known["low"]), (f"range {UPPER}", known["high"])):
                    curves.append(LiteratureCurve(known["source"], muscle, name, part, ends, np.full(2, arm)))
        return tuple(curves)

    def with_literature(self, path: str | PathLike[str]) -> Self:
        """Return the same result with published moment arms, which figures and the page then show.

        ``path`` is a table as :func:`vtkmuscle.io.read_literature` takes it; a ValueError is raised if it has
        none of the muscles, or none of the coordinates, of the result.
        """
        own = literature_of(Path(path), self.muscle_names, [*self.motion.coordinates])
        other = copy(self)
        other.literature = {**self.literature, **own}
        return other


def _read_only(rows: Mapping[str, Sequence[Floats]]) -> dict[str, Floats]:
    """Return arrays of rows per frame. They are read-only, for moment arms are computed from them once."""
    arrays = {name: np.array(values) for name, values in rows.items() if values}
    for array in arrays.values():
        array.setflags(write=False)
    return arrays


def _wrapped(data: vtkDataObject | None) -> Any:
    """Return a copy of data as PyVista's. A change of it reaches neither result nor scene."""
    import pyvista  # noqa: PLC0415 -- a run needs none

    return None if data is None else pyvista.wrap(data).copy()


def _listed(values: Sequence[float]) -> str:
    """Return the first and last of some numbers in words."""
    words = [f"{value:g}" for value in values]
    return f"there are {', '.join(words if len(words) <= 6 else [*words[:3], '...', *words[-2:]])}"


def _made_of(kind: type[ResultData], bones: Any, parts: Any, more: dict[str, Any]) -> ResultData:
    return kind(multiblock_from(dict(bones)), *parts, **more)


#: Labels of times that are no coordinate: numbers of poses, as on a grid, and any time.
UNNAMED = ("pose", "time")


def time_label(motion: RigidMotion) -> str:
    """Return the label of a motion's times: a coordinate with its unit, or one of :data:`UNNAMED`."""
    times, axes = motion.times, motion.coordinates.items()  # values in radians are rounded
    equal = (label_of(q, own.unit) for q, own in axes if np.allclose(own.values, times, rtol=0.0, atol=1e-9))
    return next(equal, UNNAMED[0] if np.array_equal(times, np.arange(len(times))) else UNNAMED[1])
