"""What a run of a scene gives back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkMultiBlockDataSet

from vtkmuscle.core.accuracy.estimate import Estimate
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.measures import smoothed_curve
from vtkmuscle.core.moment_arms.of_joints import JointArms, joint_arms
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.words import suggestion
from vtkmuscle.data.arrays import with_points
from vtkmuscle.filters.bone_motion import BoneMotion
from vtkmuscle.io.literature import LiteratureCurve
from vtkmuscle.run.limits import CHECKS
from vtkmuscle.run.loading import read_result
from vtkmuscle.run.moment_arms import MomentArmTable
from vtkmuscle.run.table import Table
from vtkmuscle.run.track import MuscleTrack

Floats = NDArray[np.float64]


class Result:
    """The muscles, fibres and bones of a run, frame by frame, and its report.

    Parameters
    ----------
    name : str
        Name of the scene.
    units : str
        Unit of all coordinates.
    bones : vtkMultiBlockDataSet
        The bones at rest.
    motion : RigidMotion
        How they move.
    frames : sequence of int
        Numbers of the frames that were kept.
    tracks : dict of str to MuscleTrack
        The finished frames of each muscle.
    report : dict
        What was measured; ``report["definitions"]`` says what each number means.
    literature : mapping of str to sequence of LiteratureCurve, optional
        Published moment arms per muscle.
    crosses : mapping of str to sequence of str, optional
        Coordinates of the motion that each muscle crosses, where that is known.

    Attributes
    ----------
    name, units, report, motion, literature, crosses
        As given.
    frames : list of int
        Numbers of the kept frames in the motion, counted from 0.
    times : list of float
        Their pipeline times.
    time_label : str
        What these are: a coordinate with its unit, where they are one.
    muscle_names : list of str
        In the order of the scene.
    verdicts : dict of str to str
        Of each muscle ``"ok"``, ``"look"`` or ``"failed"``; ``report["muscles"][NAME]["verdict"]`` says why.
    lengths : dict of str to (frames, fibres) array
        Fibre lengths [mm] of the muscles that have fibres, a row per finished frame.

    Examples
    --------
    >>> from vtkmuscle import Scene, phantoms
    >>> result = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8).run(frames="0:3")
    >>> result
    Result('spindle_over_hinge': 3 frames of spindle (ok))

    By muscle, and by frame or time; surfaces and fibres are PyVista's:

    >>> result.lengths["spindle"].shape
    (3, 8)
    >>> result.muscle("spindle", time=result.times[1]).plot()  # doctest: +SKIP
    >>> result.fibres("spindle", frame=2).n_cells
    8

    As tables, which ``to_frame()`` gives to pandas:

    >>> table = result.length_table()
    >>> table
    Table: 24 rows of muscle, fibre, frame, time, length_mm, length_err_mm
    >>> table.where(frame=2)["length_mm"].shape
    (8,)
    >>> result.frame_table().where(muscle="spindle")["volume_ratio"].round(6)
    array([1., 1., 1.])
    """

    def __init__(
        self,
        name: str,
        units: str,
        bones: vtkMultiBlockDataSet,
        motion: RigidMotion,
        frames: Sequence[int],
        tracks: dict[str, MuscleTrack],
        report: dict[str, Any],
        *,
        literature: Mapping[str, Sequence[LiteratureCurve]] | None = None,
        crosses: Mapping[str, Sequence[str]] | None = None,
    ) -> None:
        self.name = name
        self.motion = motion
        self.time_label = _time_label(motion)
        self.literature: Mapping[str, Sequence[LiteratureCurve]] = dict(literature or {})
        self.crosses: Mapping[str, Sequence[str]] = dict(crosses or {})
        self.units = units
        self.report: Mapping[str, Any] = report
        self.frames: Sequence[int] = list(frames)
        self.times: Sequence[float] = [float(motion.times[frame]) for frame in self.frames]
        self.muscle_names: Sequence[str] = list(tracks)
        self.lengths: Mapping[str, Floats] = {
            name: np.array(track.lengths) for name, track in tracks.items() if track.lengths
        }
        self.verdicts: Mapping[str, str] = {
            name: track.report["verdict"]["verdict"] for name, track in tracks.items()
        }
        self._tracks = tracks
        self._bones = bones
        self._mover = BoneMotion(motion=motion)
        self._mover.connect(0, bones)

    @classmethod
    def load(cls, folder: str | PathLike[str]) -> Self:
        """Read the result of a finished run back from its folder.

        Parameters
        ----------
        folder : path
            What was given to :meth:`vtkmuscle.Scene.run` as ``out``, or to ``vtkmuscle run`` as ``--out``.

        Returns
        -------
        Result
            The same as the run gave: muscles, fibres, lengths, bones, motion, report and verdicts.

        Raises
        ------
        ValueError
            If it is not the folder of a run, the run did not end, or a file in it is missing or is not what
            the run wrote; the message says which.

        Examples
        --------
        >>> from tempfile import mkdtemp
        >>> from vtkmuscle import Result, Scene, phantoms
        >>> scene = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8)
        >>> out = mkdtemp()
        >>> result = scene.run(out, frames="0:2", figures=False)
        >>> Result.load(out)
        Result('spindle_over_hinge': 2 frames of spindle (ok))
        """
        return cls(**read_result(Path(folder)))

    def __repr__(self) -> str:
        muscles = ", ".join(f"{name} ({self.verdicts[name]})" for name in self.muscle_names)
        return f"Result({self.name!r}: {len(self.times)} frames of {muscles})"

    @property
    def errors(self) -> dict[str, Mapping[str, Estimate]]:
        """Per muscle the quantities with their errors, see :mod:`vtkmuscle.accuracy.estimates`.

        ``errors["iliacus"]["length"].total`` is that of the mean length in each frame,
        ``errors["iliacus"]["moment_arm_hip_flexion_r"].parts["model"]`` a part of that of the moment arm.
        """
        return {name: track.errors for name, track in self._tracks.items()}

    def finished(self, name: str) -> int:
        """Return how many of the kept frames a muscle has: all, or those before the one that failed."""
        return len(self._tracks[name].report["frames"])

    def smoothed_lengths(self, *, passes: int = 5) -> dict[str, Floats]:
        """Return the fibre lengths without their noise over the frames.

        Parameters
        ----------
        passes : int, optional
            How often l_i becomes (l_{i-1} + 4 l_i + l_{i+1}) / 6, the ends kept; Kohout and Cervenka 2021,
            section 4.4, has five.

        Returns
        -------
        dict of str to (frames, fibres) array
            As ``lengths`` [mm].
        """
        return {name: smoothed_curve(lengths, passes=passes) for name, lengths in self.lengths.items()}

    def moment_arms(self, *coordinates: str) -> MomentArmTable:
        """Return the moment arms of all fibres, -dl/dq, over the kept frames.

        Parameters
        ----------
        *coordinates : str
            Names of coordinates of the motion; default: all that change.

        Returns
        -------
        MomentArmTable
            Per muscle and coordinate arms, standard errors and a quartic fit [mm], see
            :class:`~vtkmuscle.core.moment_arms.of_joints.JointArms`; ``table()`` and ``write`` give a table.

        Raises
        ------
        ValueError
            If no muscle has fibres, the motion has no such coordinate or none that changes, or the frames
            have too few different values of it.
        """
        if not self.lengths:
            raise InputError(
                "", "no muscle of the run has fibres, so there are no moment arms", "give it fibres"
            )
        motion = self.motion.part(self.frames)
        arms: dict[str, dict[str, JointArms]] = {}
        refused: dict[str, str] = {}
        problems: list[InputError] = []
        for name, lengths in self.lengths.items():
            if len(lengths) < len(self.frames):
                continue  # it failed on the way
            crossed = self.crosses.get(name)
            among = coordinates or tuple(motion.coordinates)
            if crossed is not None and not any(
                one in among and motion.coordinates[one].changes for one in crossed
            ):
                continue  # it crosses none that moves
            try:
                arms[name], without = joint_arms(lengths, motion, coordinates or None, crossed=crossed)
            except InputError as error:  # of this muscle alone, where others cross other coordinates
                problems.append(error)
                without = dict.fromkeys(crossed or among, str(error))
            refused |= without
        if problems and not arms:
            raise problems[0]
        return MomentArmTable(arms, refused, self.errors)

    def length_table(self) -> Table:
        """Return the fibre lengths, a row per muscle, fibre and frame: as lengths.csv, and the frame."""
        return Table(
            ("muscle", "fibre", "frame", "time", "length_mm", "length_err_mm"),
            (
                (name, fibre, frame, time, length, error)
                for name, lengths in self.lengths.items()
                for fibre, (curve, errors) in enumerate(
                    zip(lengths.T, length_errors(self.errors[name], lengths).T, strict=True)
                )
                for frame, time, length, error in zip(self.frames, self.times, curve, errors, strict=False)
            ),
        )

    def frame_table(self) -> Table:
        """Return the figures of the report, a row per muscle and frame; NaN where a muscle has none.

        ``report["definitions"]`` says what they are. What is no number, as the measures of fibres, is left to
        the report.
        """
        muscles = self.report["muscles"]
        rows = [{"muscle": name, **row} for name in self.muscle_names for row in muscles[name]["frames"]]
        known = {
            key: None for row in rows for key, value in row.items() if not isinstance(value, dict | list)
        }
        return Table(tuple(known), ([row.get(key) for key in known] for row in rows))

    def muscle(self, name: str, *, frame: int | None = None, time: float | None = None) -> Any:
        """Return a muscle in a kept frame, with the arrays it has at rest (``FixedTo`` and its own).

        Parameters
        ----------
        name : str
            Name of the muscle.
        frame : int, optional
            Number of the frame in the motion, one of ``frames``.
        time : float, optional
            Time of the frame, one of ``times``, instead.

        Returns
        -------
        pyvista.PolyData
            The surface.

        Raises
        ------
        ValueError
            If there is no such muscle or kept frame, or the scene's model is ``"paths"``, which deforms no
            muscle.
        """
        i, track = self._position(frame, time), self._track(name)
        if self.report["model"] == "paths":
            raise InputError(
                "",
                f"the scene's model is 'paths', so that {name!r} was not deformed",
                f"fibres({name!r}, frame={self.frames[i]}) has its fibres, and model 'volume' deforms it",
            )
        self._check_finished(name, i)
        return _wrapped(with_points(track.rest, track.points[i]))

    def fibres(self, name: str, *, frame: int | None = None, time: float | None = None) -> Any:
        """Return the fibres of a muscle in a kept frame, None where it has none; see :meth:`muscle`."""
        i, track = self._position(frame, time), self._track(name)
        if not track.fibres and track.rest_fibres is None:
            return None
        self._check_finished(name, i)
        return _wrapped(track.fibres[i])

    def bones(self, *, frame: int | None = None, time: float | None = None) -> Any:
        """Return the bones in a kept frame, a block each, with the field array ``Transform``."""
        moved = vtkMultiBlockDataSet()
        moved.ShallowCopy(self._mover.update(time=self.times[self._position(frame, time)]).output)
        return _wrapped(moved)

    def rest_muscle(self, name: str) -> Any:
        """Return a muscle at rest, with the point array ``FixedTo``."""
        rest = self._track(name).rest
        assert rest is not None  # a result is made when all muscles are done
        return _wrapped(rest)

    def rest_fibres(self, name: str) -> Any:
        """Return the fibres of a muscle at rest, None where it has none."""
        fibres = self._track(name).rest_fibres
        return None if fibres is None else _wrapped(fibres)

    def rest_bones(self) -> Any:
        """Return the bones at rest."""
        return _wrapped(self._bones)

    def write_report(self, path: str | PathLike[str]) -> Path:
        """Write the page of the run: the scene to be turned and moved, curves, tables and verdicts.

        Parameters
        ----------
        path : path
            The .html file; replaced where it exists. It holds all that it shows and needs no network.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        ValueError
            If the name does not end in .html.
        """
        from vtkmuscle.report import write_page  # noqa: PLC0415 -- only a page needs its parts

        if Path(path).suffix.lower() not in (".html", ".htm"):
            raise InputError(str(path), "a report is a page of HTML", "give it a name that ends in .html")
        return write_page(path, self, CHECKS)

    def _track(self, name: str) -> MuscleTrack:
        if name not in self._tracks:
            raise InputError("", f"there is no muscle {name!r} in the result", suggestion(name, self._tracks))
        return self._tracks[name]

    def _position(self, frame: int | None, time: float | None) -> int:
        """Return the place of a frame, given by its number or its time, among those that are kept."""
        if (frame is None) == (time is None):
            raise InputError("", "give either the number of a frame (frame=10) or its time (time=20.0)")
        if frame is not None:
            if frame not in self.frames:
                raise InputError("", f"frame {frame} was not kept", f"there are {_listed(self.frames)}")
            return self.frames.index(frame)
        near = np.flatnonzero(np.isclose(self.times, float(time), rtol=1e-9, atol=1e-9))  # type: ignore[arg-type]
        if not len(near):
            raise InputError("", f"no frame of time {time:g} was kept", f"there are {_listed(self.times)}")
        return int(near[0])

    def _check_finished(self, name: str, i: int) -> None:
        if i >= self.finished(name):
            raise InputError(
                "",
                f"{name!r} failed before frame {self.frames[i]}, so that it is not there",
                f"it has {self.finished(name)} of {len(self.frames)} frames",
            )


def length_errors(errors: Mapping[str, Estimate], lengths: Floats) -> Floats:
    """Return the errors of fibre lengths (f, k), NaN where they are not known [mm]."""
    known = errors.get("fibre_length")
    return np.full(lengths.shape, np.nan) if known is None else known.total


def _wrapped(data: vtkDataObject) -> Any:
    """Return a data set as PyVista has it."""
    import pyvista  # noqa: PLC0415 -- a run needs none

    return pyvista.wrap(data)


def _listed(values: Sequence[float]) -> str:
    """Return the first and last of some numbers in words."""
    words = [f"{value:g}" for value in values]
    return ", ".join(words if len(words) <= 6 else [*words[:3], "...", *words[-2:]])


def _time_label(motion: RigidMotion) -> str:
    for name, one in motion.coordinates.items():
        if np.array_equal(one.values, motion.times):
            return f"{name.replace('_', ' ')} [{one.unit}]"
    return "time"
