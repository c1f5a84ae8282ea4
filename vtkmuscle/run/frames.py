"""The frames of a run: those of one muscle while it runs, and all that are kept, by frame or time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from functools import cached_property
from typing import Any, Self

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkMultiBlockDataSet

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.estimate import Estimate
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.data.arrays import points_of, with_points
from vtkmuscle.data.drawn_bones import DrawnBones
from vtkmuscle.data.paths import Paths, paths_of
from vtkmuscle.filters.bone_motion import BoneMotion
from vtkmuscle.guesses import WithHints
from vtkmuscle.io.literature import LiteratureCurve
from vtkmuscle.run.tracks import MuscleTrack


class KeptFrames(WithHints):
    """The muscles, fibres and bones of a run, frame by frame; parameters as of :class:`vtkmuscle.Result`."""

    def __init__(
        self,
        bones: vtkMultiBlockDataSet,
        motion: RigidMotion,
        tracks: Mapping[str, MuscleTrack],
        report: dict[str, Any],
        *,
        literature: Mapping[str, Sequence[LiteratureCurve]] | None = None,
        crosses: Mapping[str, Sequence[str]] | None = None,
        drawn_bones: DrawnBones | None = None,
    ) -> None:
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
        self.verdicts: Mapping[str, str] = {
            name: one["verdict"]["verdict"]
            for name in tracks
            if "verdict" in (one := report["muscles"][name])
        }
        self._known_arms: dict[tuple[str, ...], Any] = {}
        self._tracks = tracks
        self._wrap = _wrapped
        self._bones = bones
        self.drawn_bones = drawn_bones or DrawnBones(bones)
        self._mover = BoneMotion(motion=motion)
        self._mover.connect(0, bones)

    def plain(self) -> Self:
        """Return the same with surfaces and lines as VTK has them, so that PyVista need not be loaded."""
        other = copy(self)
        other._wrap = lambda data: data
        return other

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
        return any(one.get("moment_arms") for one in self.report["muscles"].values())

    @property
    def errors(self) -> dict[str, Mapping[str, Estimate]]:
        """Per muscle the quantities with their errors, see :mod:`vtkmuscle.accuracy.estimates`.

        ``errors["iliacus"]["length"].total`` is that of the paths' mean length in each frame,
        ``fibre_length`` of the fibres', ``each_length`` and ``each_fibre_length`` of every one;
        ``errors["iliacus"]["moment_arm_hip_flexion_r"].parts["model"]`` a part of that of the moment arm.
        """
        return {name: track.errors for name, track in self._tracks.items()}

    def wrenches(self, name: str) -> dict[str, Floats]:
        """Return what the paths of a muscle, each at a tension of 1, do to the bones in each finished frame.

        By bone (frames, paths, 6): force [1], and moment about the scene's origin [unit of the scene].
        """
        return self._track(name).wrenches()

    def finished(self, name: str) -> int:
        """Return how many of the kept frames a muscle has: all, or those before the one that failed."""
        return len(self.report["muscles"][name]["frames"])

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
        return self._wrap(with_points(track.rest, points_of(track.surfaces[i])))

    def fibres(self, name: str, *, frame: int | None = None, time: float | None = None) -> Any:
        """Return the fibres of a muscle in a kept frame, None where it has none; see :meth:`muscle`."""
        i, track = self._position(frame, time), self._track(name)
        if not track.fibres and track.rest_fibres is None:
            return None
        self._check_finished(name, i)
        return self._wrap(track.fibres[i])

    def paths(self, name: str, *, frame: int | None = None, time: float | None = None) -> Paths:
        """Return the paths of a muscle in a kept frame, in the scene's unit.

        Returns
        -------
        Paths
            Their ``lengths`` (k,), ``points`` (k, n, 3), and ``wrenches``: per bone (k, 6) the force [1] and
            the moment about the origin that each exerts on it at a tension of 1.

        Raises
        ------
        ValueError
            If there is no such muscle or kept frame, or the muscle has no paths.
        """
        i, track = self._position(frame, time), self._track(name)
        found = paths_of(self.fibres(name, frame=self.frames[i]), name) if track.lengths else None
        if found is None:
            raise InputError("", f"{name!r} has no paths", "give it fibres, and areas on two bones")
        return found

    def bones(self, *, frame: int | None = None, time: float | None = None) -> Any:
        """Return the bones in a kept frame, a block each, with the field array ``Transform``."""
        moved = vtkMultiBlockDataSet()
        moved.ShallowCopy(self._mover.update(time=self.times[self._position(frame, time)]).output)
        return self._wrap(moved)

    def rest_muscle(self, name: str) -> Any:
        """Return a muscle at rest, with the point array ``FixedTo``."""
        rest = self._track(name).rest
        assert rest is not None  # a result is made when all muscles are done
        return self._wrap(rest)

    def rest_fibres(self, name: str) -> Any:
        """Return the fibres of a muscle at rest, None where it has none."""
        fibres = self._track(name).rest_fibres
        return None if fibres is None else self._wrap(fibres)

    def rest_bones(self) -> Any:
        """Return the bones at rest."""
        return self._wrap(self._bones)

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


class ByMuscle(dict[str, Floats]):
    """Arrays by the name of a muscle, told in a line each."""

    def __repr__(self) -> str:
        return "\n".join(
            f"{name}: {one.shape} array, {one.min():.4g} to {one.max():.4g}" for name, one in self.items()
        )


def _read_only(rows: Mapping[str, Sequence[Floats]]) -> ByMuscle:
    """Return arrays of what is there per frame, not to be changed: moment arms by them are found once."""
    arrays = ByMuscle({name: np.array(one) for name, one in rows.items() if one})
    for array in arrays.values():
        array.setflags(write=False)
    return arrays


def _wrapped(data: vtkDataObject) -> Any:
    """Return a data set as PyVista has it."""
    import pyvista  # noqa: PLC0415 -- a run needs none

    return pyvista.wrap(data)


def _listed(values: Sequence[float]) -> str:
    """Return the first and last of some numbers in words."""
    words = [f"{value:g}" for value in values]
    return ", ".join(words if len(words) <= 6 else [*words[:3], "...", *words[-2:]])


def time_label(motion: RigidMotion) -> str:
    """Return what the times of a motion are: a coordinate with its unit, where they are one."""
    for name, one in motion.coordinates.items():
        if np.array_equal(one.values, motion.times):
            return f"{name.replace('_', ' ')} [{one.unit}]"
    return "time"
