"""MomentArms: the levers of paths about a joint, or how much fibres shorten as it turns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.moment_arms.levers import differences_by, interval_among
from vtkmuscle.core.moment_arms.of_joints import checked_coordinates, known_coordinates
from vtkmuscle.core.motion.coordinates import ANGLES, TRANSLATIONS, Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import (
    Polylines,
    cell_array,
    field_array,
    polylines_of,
    set_cell_array,
    set_field_array,
)
from vtkmuscle.data.paths import paths_of
from vtkmuscle.data.pipeline_times import input_at, requested_time, state_of_inputs, times_of
from vtkmuscle.filters.base import Filter, OutputPort, Parameter, ports

#: Arrays of fibres that have their lengths of all times with them.
LENGTHS, TIMES = "Lengths", "Times"


class MomentArms(Filter):
    """Add moment arms of a muscle's paths about a joint; of other fibres those by their lengths over time.

    Where the fibres have paths with them (the output of TautPaths, or of FibreMetrics with paths)
    and there is a ``motion``, a moment arm is the lever of the path's pull about the axis of the coordinate,
    ``Lever_COORDINATE`` (:mod:`vtkmuscle.core.paths.levers`). That takes the one pose alone, also where
    several coordinates change at once, as long as the joint is known or poses differ in the one coordinate
    only.

    Of other fibres it is the slope -dl/dq of their lengths, by differences between poses that differ in the
    one coordinate only (:func:`vtkmuscle.core.moment_arms.levers.differences_by`), as the slopes of a run's
    tables. They are asked for at every time step that is announced; what was measured is kept until something
    upstream changes. Fibres that announce no time steps must have their history with them: the cell array
    ``Lengths`` and the field array ``Times``. Of a motion with one coordinate those frames count in which the
    bones' rotation depends on it alone, and not a way from rest to the sweep's start.

    A fibre that shortens as the coordinate q grows has a positive moment arm. The coordinate is one of the
    ``motion``, or where none is given the pipeline's time.

    Parameters
    ----------
    fibres
        Polylines, the same number at each time step; or, without time steps, with the cell array ``Lengths``
        (n_fibres, f) [mm] and the field array ``Times`` (f,).
    motion
        Has the coordinates; None: the pipeline's time is one.
    coordinate
        Name of one of the motion's coordinates; None: all that change.
    unit
        Unit of the pipeline's time, where that is the coordinate.

    Attributes
    ----------
    output
        The fibres with the cell array ``MomentArm`` [mm] and the field arrays ``Coordinate`` (its name) and
        ``CoordinateValue`` (in its unit); by several coordinates each of these arrays has _NAME after its
        own. In a pose in which a moment arm is not known, such as one before the sweep, its arrays are not
        there.

    Raises
    ------
    ValueError
        If there are no fibres or a point is not finite, if there are neither time steps nor a history, if the
        number of fibres changes with time, or if the motion has no such coordinate; of fibres without paths
        also if it has too few different values (4 for one coordinate), or if several coordinates only change
        together.

    References
    ----------
    An, Takahashi, Harrigan, Chao 1984, *Determination of muscle orientations and moment arms*,
    doi:10.1115/1.3138494.

    Examples
    --------
    >>> from vtkmuscle.filters import MomentArms
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> from vtkmuscle.pipelines import decompose, pull_taut
    >>> phantom = spindle_over_hinge()
    >>> muscle, areas = phantom.muscles["spindle"], phantom.attachments["spindle"]
    >>> rest = decompose(muscle, areas, n_fibres=8)
    >>> taut = pull_taut(muscle, phantom.bones, phantom.motion, rest, areas)
    >>> MomentArms(fibres=taut, motion=phantom.motion).apply(time=20.0)["MomentArm"].shape
    (8,)
    """

    motion: Parameter[RigidMotion | None] = Parameter(RigidMotion, default=None)
    coordinate: Parameter[str | None] = Parameter(str, default=None)
    unit = Parameter(str, default="deg", choices=(*ANGLES, *TRANSLATIONS))

    fibres = ports.Lines()
    output = OutputPort(vtkPolyData)

    def __init__(self, **parameters: Any) -> None:
        self._steps: tuple[float, ...] = ()
        self._measured: tuple[list[int], Floats] | None = None
        super().__init__(**parameters)

    def RequestUpdateExtent(self, request: Any, inInfo: Any, outInfo: Any) -> int:
        """Note the time steps; :meth:`execute` asks for fibres at the other ones where it needs them."""
        self._steps = times_of(inInfo[0].GetInformationObject(0))
        self.request_time = requested_time(outInfo.GetInformationObject(0))
        return 1

    def execute(self, fibres: Polylines) -> vtkPolyData:
        """Return the fibres at the time asked for, with their moment arms."""
        data: Any = fibres.data
        if self.motion is not None and paths_of(data, "fibres") is not None:
            return self._of_paths(fibres, self.motion)
        if data.GetCellData().HasArray(LENGTHS):
            times, lengths = _history(data, len(fibres))
        elif self._steps:
            times, lengths = np.array(self._steps), self._lengths_over_time()
        else:
            raise InputError(
                "fibres",
                "they announce no time steps, and have no cell array 'Lengths'",
                "connect a filter over time, e.g. FibreTransport behind PBDDeformer, or a reader of a .pvd "
                "series",
            )
        now = float(times[-1]) if self.request_time is None else self.request_time
        result = self._at(now, fibres).copy()
        motion = RigidMotion(times, {}, None, {"time": Coordinate(times, self.unit)})
        if self.motion is not None:
            motion = _resampled(self.motion, times)

        now = float(np.clip(now, times.min(), times.max()))
        names = known_coordinates(motion)
        arms = {}
        for name in names:
            near = differences_by(motion, name, names)
            interval = interval_among(near.frames, times, now)
            if interval is not None:
                (a, b, part), slopes = interval, near.slopes(lengths)
                arms[name] = -(1.0 - part) * slopes[a] - part * slopes[b]
        self._add_arms(result, motion, now, arms)
        return result

    def _at(self, now: float, fibres: Polylines) -> Polylines:
        """Return the fibres at a time: the input stands where it was asked for last."""
        again = input_at(self, 0, now) if self._steps else None
        return fibres if again is None else polylines_of(again, "fibres")

    def _lengths_over_time(self) -> Floats:
        """Return the lengths (f, k) of the fibres at all time steps."""
        state = state_of_inputs(self, (0,))
        if self._measured is None or self._measured[0] != state:
            rows: list[Floats] = []
            for number, time in enumerate(self._steps):
                self.report_progress(number / len(self._steps))
                data = input_at(self, 0, time)
                if data is None:
                    raise RuntimeError(f"MomentArms: the fibres at time {time:g} could not be computed")
                lines = polylines_of(data, f"fibres at time {time:g}")
                rows.append(polyline_lengths(lines.points, lines.offsets))
                if len(rows[-1]) != len(rows[0]):
                    raise InputError(
                        "fibres",
                        f"at time {time:g} there are {len(rows[-1])}, at first {len(rows[0])}",
                        "they must be the same fibres at all times",
                    )
            self._measured = state_of_inputs(self, (0,)), np.array(rows)
        return self._measured[1]

    def _of_paths(self, fibres: Polylines, motion: RigidMotion) -> vtkPolyData:
        """Return fibres with the levers of their paths."""
        now = float(motion.times[-1]) if self.request_time is None else self.request_time
        result = self._at(now, fibres).copy()
        paths = paths_of(result, "fibres")
        assert paths is not None  # it had some at another time
        self._add_arms(result, motion, now, paths.levers)
        return result

    def _add_arms(
        self, result: vtkPolyData, motion: RigidMotion, now: float, arms: Mapping[str, Floats]
    ) -> None:
        """Add the moment arms (k,) that are known now, by coordinates of the motion."""
        wanted = None if self.motion is None else self.coordinate
        checked_coordinates(motion, [wanted] if wanted else ())
        names = known_coordinates(motion)
        for name in names:
            if wanted not in (None, name) or name not in arms:
                continue
            suffix = f"_{name}" if len(names) > 1 and self.coordinate is None else ""
            set_cell_array(result, f"MomentArm{suffix}", arms[name])
            set_field_array(result, f"Coordinate{suffix}", name)
            value = np.interp(now, motion.times, motion.coordinates[name].values)
            set_field_array(result, f"CoordinateValue{suffix}", float(value))


def _resampled(motion: RigidMotion, times: Floats) -> RigidMotion:
    """Return a motion at other times (f,), ascending."""
    if np.array_equal(motion.times, times):
        return motion
    poses = [motion.at(time) for time in times]
    return RigidMotion(
        times,
        {bone: np.array([pose[bone] for pose in poses]) for bone in motion.transforms},
        motion.centre,
        {
            name: Coordinate(np.interp(times, motion.times, one.values), one.unit, one.positive)
            for name, one in motion.coordinates.items()
        },
    )


def _history(fibres: vtkPolyData, count: int) -> tuple[Floats, Floats]:
    """Return the times (f,) and lengths (f, k) that fibres have with them."""
    lengths = np.asarray(cell_array(fibres, LENGTHS, "fibres"), dtype=np.float64)
    times = field_array(fibres, TIMES)
    if times is None or lengths.shape != (count, np.size(times)) or (np.diff(np.ravel(times)) <= 0).any():
        shape = "missing" if times is None else f"of shape {times.shape}"
        raise InputError(
            "fibres",
            f"the cell array 'Lengths' is of shape {lengths.shape}, the field array 'Times' {shape}",
            f"for {count} fibre(s) and f ascending times they must be ({count}, f) and (f,)",
        )
    return np.ravel(np.asarray(times, dtype=np.float64)), lengths.T
