"""MomentArms: the levers of paths about a joint, or how much fibres shorten as it turns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.moment_arms.derivatives import moment_arms
from vtkmuscle.core.moment_arms.levers import levers, twists_by
from vtkmuscle.core.moment_arms.of_joints import checked_coordinates, known_coordinates
from vtkmuscle.core.motion.coordinates import ANGLES, TRANSLATIONS, Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.motion.sweeps import frames_of_sweep
from vtkmuscle.core.types import Bools, Floats, Ints
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

    Where the fibres have paths with them (``PathWrench_BONE``: the output of TautFibres, or of FibreTransport
    behind PBDDeformer) and there is a ``motion``, a moment arm is the lever of the path's pull about the axis
    of the coordinate (:mod:`vtkmuscle.core.moment_arms.levers`). That takes the one pose alone, also where
    several coordinates change at once, as long as the joint is known or poses differ in the one coordinate
    only.

    Of other fibres it is the slope -dl/dq of their lengths, by local regression in a window that is chosen
    against the noise of the lengths (:func:`vtkmuscle.core.moment_arms.derivatives.moment_arms`), with its
    standard error. They are asked for at every time step that is announced; what was measured is kept until
    something upstream changes. Fibres that announce no time steps must have their history with them: the cell
    array ``Lengths`` and the field array ``Times``. Of a motion with one coordinate those frames count in
    which the bones' rotation depends on it alone, and not a way from rest to the sweep's start; by several a
    moment arm is determined where the poses about separate them.

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
        The fibres with the cell arrays ``MomentArm`` [mm] and, where it is a slope, ``MomentArmError`` (its
        standard error) [mm], and the field arrays ``Coordinate`` (its name) and ``CoordinateValue`` (in its
        unit); by several coordinates each of these arrays has _NAME after its own. In a pose in which a
        moment arm is not determined, such as one before the sweep, its arrays are not there.

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
        self._add_arms(result, times, lengths, float(np.clip(now, times.min(), times.max())))
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
        checked_coordinates(motion, [self.coordinate] if self.coordinate else ())
        names = known_coordinates(motion)
        wrenches = {bone: one[None] for bone, one in paths.wrenches.items()}
        for name in names:
            if self.coordinate not in (None, name):
                continue
            frames, twists = twists_by(motion, name, names)
            if not _is_known(now, motion.times, frames):
                continue
            at = {bone: _interpolated(now, motion.times[frames], one) for bone, one in twists.items()}
            arms = levers(wrenches, at)[0] if wrenches else np.zeros(len(paths.lengths))
            value = float(np.interp(now, motion.times, motion.coordinates[name].values))
            self._add(result, name, names, value, arms)
        return result

    def _add(
        self,
        result: vtkPolyData,
        name: str,
        names: Sequence[str],
        value: float,
        arms: Floats,
        errors: Floats | None = None,
    ) -> None:
        """Add what is known by a coordinate, one of several."""
        suffix = f"_{name}" if len(names) > 1 and self.coordinate is None else ""
        set_cell_array(result, f"MomentArm{suffix}", arms)
        if errors is not None:
            set_cell_array(result, f"MomentArmError{suffix}", errors)
        set_field_array(result, f"Coordinate{suffix}", name)
        set_field_array(result, f"CoordinateValue{suffix}", value)

    def _add_arms(self, result: vtkPolyData, times: Floats, lengths: Floats, now: float) -> None:
        motion = self.motion or RigidMotion(times, {}, None, {"time": Coordinate(times, self.unit)})
        one_only = self.coordinate if self.motion is not None else None
        checked_coordinates(motion, [one_only] if one_only else ())
        names, samples, counts = _coordinate_samples(motion)
        # Frames count where they and those about them do.
        counted = counts.astype(np.float64)[:, None]
        used = _interpolated(times, motion.times, counted)[:, 0] == 1.0
        known = _interpolated(now, motion.times, counted)[0, 0] == 1.0
        place = _interpolated(now, motion.times, samples)
        among = _interpolated(times, motion.times, samples)[used]
        found = moment_arms(lengths[used], among, at=place if known else None)
        for number, name in enumerate(names):
            if known and found.determined[0, number] and one_only in (None, name):
                value = float(place[0, number]) / motion.coordinates[name].factor
                arms, errors = (np.array(one[0, :, number]) for one in (found.arms, found.errors))
                self._add(result, name, names, value, arms, errors)


def _coordinate_samples(motion: RigidMotion) -> tuple[tuple[str, ...], Floats, Bools]:
    """Return the d coordinates that change, their natural values (k, d), and which of the frames (k,) count.

    Of one coordinate those of its sweep, of several all.
    """
    known = motion.coordinates
    found = tuple(name for name in known_coordinates(motion) if known[name].changes)
    if not found:
        raise InputError(
            "",
            "no coordinate of the motion changes, so no slope by it is known",
            "use more frames of the motion",
        )
    samples = np.column_stack([known[name].natural for name in found])
    used = frames_of_sweep(motion, found[0]) if len(found) == 1 else np.ones(len(samples), dtype=np.bool_)
    return found, samples, used


def _is_known(now: float, times: Floats, frames: Ints) -> bool:
    """Return whether what is known in some frames is so at a time: in those on either side of it."""
    upper = int(np.clip(np.searchsorted(times, now), 0, len(times) - 1))
    lower = upper if times[upper] <= now or upper == 0 else upper - 1
    return bool(np.isin([lower, upper], frames).all())


def _interpolated(times: Floats | float, known: Floats, samples: Floats) -> Floats:
    """Return samples (k, d), known at some times, at other ones (m, d)."""
    return np.column_stack([np.interp(np.atleast_1d(times), known, column) for column in samples.T])


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
