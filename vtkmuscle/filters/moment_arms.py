"""MomentArms: moment arms of paths or fibres about joints."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.moment_arms.of_joints import checked_coordinates, known_coordinates, slopes_by
from vtkmuscle.core.motion.coordinates import ANGLES, MILLIMETRES, Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import Polylines, add_arrays, polylines_of
from vtkmuscle.data.paths import paths_of
from vtkmuscle.data.pipeline_times import input_at, requested_time, state_of_inputs, times_of
from vtkmuscle.filters.base import Filter, OutputPort, Parameter, ports


class MomentArms(Filter):
    """Add moment arms of a muscle's paths or fibres about joints.

    With paths (from TautPaths, or FibreMetrics with paths) and a ``motion``, a moment arm is the lever of the
    path's pull about the coordinate's axis, ``Lever_COORDINATE``, in the pose alone. Without paths a moment
    arm is the slope -dl/dq of fibre lengths, by differences between poses that differ in the coordinate alone
    (:func:`vtkmuscle.core.moment_arms.levers.differences_by`); lengths at all announced time steps are kept
    until a change upstream. For a single coordinate, frames count if the bones' rotation depends on the
    coordinate alone; frames on the path from rest to the sweep do not.

    A positive moment arm means that the fibre shortens with growing q. The coordinate belongs to ``motion``,
    or is the pipeline's time without ``motion``.

    Parameters
    ----------
    fibres
        Polylines, the same number at each time step.
    motion
        Motion with coordinates; None takes the pipeline's time as the coordinate.
    coordinate
        Name of a coordinate of the motion (``"time"`` without a motion); None takes all that change.
    unit
        Unit of the pipeline's time as a coordinate.

    Attributes
    ----------
    output
        The fibres with the cell array ``MomentArm`` [mm] and the field arrays ``Coordinate`` (name) and
        ``CoordinateValue`` (in the coordinate's unit); with several coordinates each array name ends with
        _NAME. A pose without a defined moment arm, such as before the sweep, has no arrays.

    Raises
    ------
    ValueError
        If there are no fibres or a point is not finite; if there are no time steps; if the
        number of fibres changes with time; if the motion lacks the coordinate; without paths also if the
        coordinate has too few different values (4 for a single coordinate), or if several coordinates only
        change together.

    References
    ----------
    An, Takahashi, Harrigan, Chao 1984, *Determination of muscle orientations and moment arms*,
    doi:10.1115/1.3138494.

    Limitations
    -----------
    Differences of lengths are less exact than levers, above all at the ends of a sweep and with large steps.
    Fibres between aponeuroses do not include tendon, so without paths their moment arms refer to the fibres'
    shortening only.

    Examples
    --------
    >>> from vtkmuscle.filters import MomentArms
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> from vtkmuscle.pipelines import MusclePipeline
    >>> phantom = spindle_over_hinge()
    >>> scene = phantom.muscles["spindle"], phantom.bones, phantom.motion, phantom.attachments["spindle"]
    >>> taut = MusclePipeline(*scene, deformer="none", fixing={}, fibres={"n_fibres": 8}).taut_paths
    >>> MomentArms(fibres=taut, motion=phantom.motion).apply(time=20.0)["MomentArm"].shape
    (8,)
    """

    motion: Parameter[RigidMotion | None] = Parameter(RigidMotion, default=None)
    coordinate: Parameter[str | None] = Parameter(str, default=None)
    unit = Parameter(str, default="deg", choices=(*ANGLES, *MILLIMETRES))

    fibres = ports.Lines()
    output = OutputPort(vtkPolyData)

    _steps: tuple[float, ...] = ()

    def RequestUpdateExtent(self, request: Any, inInfo: Any, outInfo: Any) -> int:
        """Note the time steps; :meth:`execute` requests fibres at further times."""
        self._steps = times_of(inInfo[0].GetInformationObject(0))
        self.request_time = requested_time(outInfo.GetInformationObject(0))
        return 1

    def execute(self, fibres: Polylines) -> vtkPolyData:
        """Return the fibres at the requested time, with their moment arms."""
        data: Any = fibres.data
        of_paths = self.motion is not None and paths_of(data, "fibres") is not None
        if not of_paths and not self._steps:
            remedy = "connect a filter over time, e.g. FibreTransport behind PBDDeformer, or a .pvd reader"
            raise InputError("fibres", "the fibres have no time steps", remedy)
        motion, steps = self.motion, np.array(self._steps)
        if motion is None:
            motion = RigidMotion(steps, {}, None, {"time": Coordinate(steps, self.unit)})
        elif not of_paths:
            motion = _resampled(motion, steps)
        state = state_of_inputs(self, (0,)), self._steps
        lengths = None if of_paths else self.once("lengths", state, self._lengths_over_time)
        now = float(motion.times[-1]) if self.request_time is None else self.request_time
        lines = polylines_of(input_at(self, 0, now), "fibres") if self._steps else fibres
        result = lines.moved(lines.points)
        now = float(np.clip(now, motion.times.min(), motion.times.max()))
        names = known_coordinates(motion)
        arms: Mapping[str, Floats] = {}
        if lengths is not None:
            arms = _slopes(motion, names, lengths, now)
        elif (paths := paths_of(result, "fibres")) is not None:
            arms = paths.levers
        wanted = self.coordinate
        checked_coordinates(motion, [] if wanted is None else [wanted])
        for name in names:
            if wanted not in (None, name) or name not in arms:
                continue
            suffix = f"_{name}" if len(names) > 1 and self.coordinate is None else ""
            value = np.interp(now, motion.times, motion.coordinates[name].values)
            fields = {f"Coordinate{suffix}": name, f"CoordinateValue{suffix}": float(value)}
            add_arrays(result, cells={f"MomentArm{suffix}": arms[name]}, fields=fields)
        return result

    def _lengths_over_time(self, _state: list[int], steps: tuple[float, ...]) -> Floats:
        """Return the lengths (f, k) of the fibres at all time steps."""
        rows: list[Floats] = []
        for number, time in enumerate(steps):
            self.report_progress(number / len(steps))
            rows.append(polylines_of(input_at(self, 0, time), f"fibres at time {time:g}").lengths)
            if len(rows[-1]) != len(rows[0]):
                problem = f"at time {time:g} there are {len(rows[-1])}, at first {len(rows[0])}"
                raise InputError("fibres", problem, "connect the same fibres at all times")
        return np.array(rows)


def _slopes(motion: RigidMotion, names: tuple[str, ...], lengths: Floats, now: float) -> dict[str, Floats]:
    """Return -dl/dq (k,) at a time by coordinate, where defined, of lengths (f, k)."""
    rows = {name: slopes_by(motion, name, names, lengths, 1).T for name in names}
    arms = {name: np.array([np.interp(now, motion.times, row) for row in of]) for name, of in rows.items()}
    return {name: values for name, values in arms.items() if np.isfinite(values).all()}


def _resampled(motion: RigidMotion, times: Floats) -> RigidMotion:
    """Return a motion at other times (f,), ascending."""
    if np.array_equal(motion.times, times):
        return motion
    poses = [motion.at(time) for time in times]
    transforms = {bone: np.array([pose[bone] for pose in poses]) for bone in motion.transforms}
    coordinates = {}
    for name, old in motion.coordinates.items():
        coordinates[name] = Coordinate(np.interp(times, motion.times, old.values), old.unit, old.positive)
    return RigidMotion(times, transforms, motion.centre, coordinates)
