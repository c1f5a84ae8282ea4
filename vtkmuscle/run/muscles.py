"""One muscle's run through a scene."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.line_lengths import polyline_lengths
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import (
    field_array,
    point_array,
    points_of,
    polylines_of,
    set_cell_array,
)
from vtkmuscle.filters.base.algorithm import AbortedError
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.deformer.shape_report import read_shape
from vtkmuscle.filters.pbd_deformer import PBDDeformer
from vtkmuscle.pipelines import MusclePipeline
from vtkmuscle.run.architecture import architecture_of
from vtkmuscle.run.limits import CHECKS, FULL_SIZE
from vtkmuscle.run.measure import MuscleMeasure
from vtkmuscle.run.options import RunOptions
from vtkmuscle.run.report import fibres_at_rest, measures_of_fibres
from vtkmuscle.run.store.writing import ResultWriter
from vtkmuscle.run.track import MuscleTrack
from vtkmuscle.run.verdict import judge, slides_of
from vtkmuscle.scene.data import SceneData


@dataclass(frozen=True, eq=False)
class SceneRun:
    """What the muscles of a run share.

    Attributes
    ----------
    scene : SceneData
        What they belong to.
    numbers : range
        Of the frames that are kept.
    bones : dict of str to Bone
        The bones that have an inside, at rest.
    store : ResultWriter or None
        Where to write to.
    options : RunOptions
        What is asked for.
    stop : threading.Event
        Set to end the run early.
    """

    scene: SceneData
    numbers: range
    bones: Mapping[str, Bone]
    store: ResultWriter | None
    options: RunOptions
    stop: threading.Event = field(default_factory=threading.Event)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def report_progress(self, muscle: str, stage: str, fraction: float) -> None:
        """Tell who asked for it what is done of a muscle, one thread at a time."""
        if self.options.progress is not None:
            with self._lock:
                self.options.progress(muscle, stage, fraction)


class MuscleRun:
    """One muscle's way through all stages: fixed points, fibres, and per frame deformation and fibres.

    Parameters
    ----------
    run : SceneRun
        What it is a part of.
    name : str
        Which muscle.
    track : MuscleTrack
        Where finished frames go.
    others : sequence of MuscleRun, optional
        Muscles that this one may meet, whose runs are done: overlap with them is measured, and where the
        scene's ``muscle_contact`` is ``"on"`` this muscle is kept out of them.
    """

    def __init__(
        self, run: SceneRun, name: str, track: MuscleTrack, others: Sequence[MuscleRun] = ()
    ) -> None:
        self.run, self.scene, self.clock = run, run.scene, run.options.clock
        self.name, self.track, self.others = name, track, others
        self.deformer: PBDDeformer | None = None
        self.seconds: dict[str, float] = {}
        track.report["seconds"] = self.seconds

    def go(self) -> None:
        """Run all stages, and keep the frames that are asked for.

        Raises
        ------
        AbortedError
            If it was stopped; the frames before are complete.
        """
        numbers = self.run.numbers
        scene, name, track = self.scene, self.name, self.track
        neighbours = self._deformers() if scene.muscle_contact == "on" else None
        pipeline = muscle_pipeline(scene, name, neighbours=neighbours)
        self.deformer = pipeline.deformer
        self._report_progress("fixed points", 0.0)
        with self._timed("fixing", pipeline.fixed):
            rest = track.rest = pipeline.fixed.update().output
        _warn_if_none_is_free(name, rest)
        with self._timed("measuring"):
            measure = MuscleMeasure(track.rest, list(scene.bones), self.run.bones, scene.millimetres)
            track.report.update(measure.at_rest())
        areas = scene.muscles[name].attachments
        track.report["estimated_attachments"] = sum(area.estimated for area in areas)
        sureness = [area.sureness for area in areas if area.sureness is not None]
        track.report["attachment_sureness"] = min(sureness, default=None)
        if pipeline.fibres is not None:
            self._fill(rest, pipeline.fibres, measure)
        track.report["parameters"] = self._parameters(pipeline)
        track.report["frames"] = []
        if pipeline.deformer is None:
            self._pull(numbers, pipeline, measure)
        else:
            for number in range(numbers[-1] + 1):
                self._report_progress("deforming", number / (numbers[-1] + 1))
                self._frame(number, number in numbers, pipeline, measure)
                if track.failure is not None:
                    break
        self._judge(numbers, measure)
        if self.run.store is not None:
            with self._timed("writing"):
                self.run.store.finish(self.name, self.track)
        if scene.muscle_contact == "off":
            self.deformer = None  # with all that it keeps of the frames; later muscles do not ask for it
        self._report_progress("done", 1.0)

    def _parameters(self, pipeline: MusclePipeline) -> dict[str, Any]:
        mover = pipeline.taut if pipeline.deformer is None else pipeline.deformer
        assert mover is not None
        fibres = self.scene.muscles[self.name].fibres
        if fibres is not None and pipeline.transport is not None:
            fibres = {**fibres, "weight_tolerance": pipeline.transport.weight_tolerance}
        return {
            "solver": mover.parameters(),
            "fixing": pipeline.fixed.parameters(),
            "fibres": None if fibres is None else dict(fibres),
        }

    def _fill(self, rest: vtkPolyData, fibres: Filter, measure: MuscleMeasure) -> None:
        """Fill the muscle with fibres, and measure them at rest."""
        track, millimetres = self.track, self.scene.millimetres
        self._report_progress("fibres", 0.0)
        with self._timed("fibres", fibres):
            track.rest_fibres = fibres.update().output
        with self._timed("measuring"):
            rested = polylines_of(track.rest_fibres, "fibres")
            measure.take_fibres_at_rest(rested.points, rested.offsets)
            areas = self.scene.attachments_data(self.name)
            track.report["fibres"] = fibres_at_rest(track.rest_fibres, rest, millimetres)
            hill, sheets = self.scene.muscles[self.name].hill, self.scene.aponeuroses_data(self.name)
            track.report["architecture"] = architecture_of(
                track.rest_fibres, rest, areas, millimetres, hill, sheets
            )
        track.report["fibre_measures"] = []

    def _pull(self, numbers: range, pipeline: MusclePipeline, measure: MuscleMeasure) -> None:
        """Run model ``"paths"``: the fibres pulled taut in each frame, and nothing else."""
        assert pipeline.metrics is not None
        for number in numbers:
            self._report_progress("pulling fibres", number / (numbers[-1] + 1))
            now = float(self.scene.motion.times[number])
            before = self.clock()
            with self._timed("pulling fibres", pipeline.metrics):
                found = _copy(pipeline.metrics.update(time=now).output)
            took = self.clock() - before
            _add_penetration(found, measure, self.scene.motion.at(now))
            unsettled = field_array(found, "Unsettled")
            row = {
                "frame": number,
                "time": now,
                "unsettled": 0 if unsettled is None else int(unsettled[0]),
            }
            self._keep(row | {"ms": 1000.0 * took}, None, found)

    def _frame(self, number: int, wanted: bool, pipeline: MusclePipeline, measure: MuscleMeasure) -> None:
        now = float(self.scene.motion.times[number])
        assert pipeline.deformer is not None
        before = self.clock()
        try:
            with self._timed("deforming", pipeline.deformer):
                deformed = pipeline.deformer.update(time=now).output
            self._check_finite(points_of(deformed), number)
        except ValueError as error:
            # In the first frame it is what was given that is wrong; later the muscle has gone astray.
            if number == 0:
                raise
            self.track.failure = number, now, error
            return
        took = self.clock() - before
        if not wanted:
            return
        points = points_of(deformed)
        transforms = self.scene.motion.at(now)
        fibres = None
        before = self.clock()
        if pipeline.transport is not None and pipeline.metrics is not None:
            with self._timed("transport", pipeline.transport):
                pipeline.transport.update(time=now)
            with self._timed("metrics", pipeline.metrics):
                fibres = _copy(pipeline.metrics.update(time=now).output)
        fibres_took = self.clock() - before
        with self._timed("measuring"):
            row = {
                "frame": number,
                "time": now,
                **read_shape(deformed, self.scene.millimetres),
                **measure.frame(points, transforms),
            }
            if fibres is not None:
                depths = _add_penetration(fibres, measure, transforms)
                lines = polylines_of(fibres, "fibres")
                row |= measure.fibres(lines.points, lines.offsets, points, depths)
                row["ms_fibres"] = 1000.0 * fibres_took
        if self.scene.muscle_contact != "off":
            with self._timed("measuring overlap"):
                others = self._deformers().values()
                row.update(measure.overlap(points, (other.update(time=now).output for other in others)))
        row["ms"] = 1000.0 * took
        self._keep(row, deformed, fibres)

    def _keep(self, row: dict[str, Any], deformed: vtkPolyData | None, fibres: vtkPolyData | None) -> None:
        """Write a frame and keep it: all of it is there then, or nothing."""
        number, now = row["frame"], row["time"]
        if self.run.store is not None:
            with self._timed("writing"):
                self.run.store.write_frame(self.name, number, deformed, fibres)
        if deformed is not None:
            self.track.points.append(points_of(deformed))
        if fibres is not None:
            self.track.keep(fibres, self.scene.millimetres)
            measures = measures_of_fibres(fibres, self.scene.millimetres)
            self.track.report["fibre_measures"].append({"frame": number, "time": now, **measures})
        self.track.report["frames"].append(row)
        if self.run.options.observe is not None:
            self.run.options.observe(self.name, row)

    def _judge(self, numbers: range, measure: MuscleMeasure) -> None:
        """Add the verdict on the frames that are there to the report."""
        track, millimetres = self.track, self.scene.millimetres
        rows = track.report["frames"]
        lengths = rest_lengths = None
        slides: list[tuple[float, str] | None] = []
        motion = self.scene.motion.part(numbers[: len(rows)]) if rows else None
        if track.fibre_lengths and track.rest_fibres is not None:
            lines = polylines_of(track.rest_fibres, "fibres")
            lengths, rest_lengths = (
                np.array(track.fibre_lengths),
                polyline_lengths(lines.points, lines.offsets),
            )
            rest_lengths = rest_lengths * millimetres
            slides = self._slides(lengths, motion, measure)
        track.report["verdict"] = judge(
            rows,
            lengths=lengths,
            rest_lengths=rest_lengths,
            slides=slides,
            at_rest=None if lengths is None else track.report["fibres"],
            motion=motion,
            n_edges=measure.n_edges,
            size=measure.size,
            failure=track.failure,
        )

    def _slides(
        self, lengths: Floats, motion: RigidMotion | None, measure: MuscleMeasure
    ) -> list[tuple[float, str] | None]:
        """Return how far fibres whose length jumps have slid aside on bones; nothing where it is unknown."""
        lines = [polylines_of(fibres, "fibres") for fibres in self.track.fibres]
        sizes = {size for one in lines for size in np.diff(one.offsets).tolist()}
        if motion is None or len(sizes) != 1:
            return []
        jump = CHECKS["jumps"].look * min(1.0, measure.size / FULL_SIZE)
        points = [one.points.reshape(len(one), -1, 3) for one in lines]
        millimetres = self.scene.millimetres
        return slides_of(lengths, points, motion, self.run.bones, jump=jump, millimetres=millimetres)

    def _deformers(self) -> dict[str, PBDDeformer]:
        """Return the deformers of the other muscles, without those that failed on the way."""
        whole = [other for other in self.others if other.track.failure is None]
        return {other.name: other.deformer for other in whole if other.deformer is not None}

    def _check_finite(self, points: Any, number: int) -> None:
        if not np.isfinite(points).all():
            problem = "the deformed muscle has coordinates that are not finite"
            remedy = "lower the stiffnesses, or use smaller steps of the motion"
            raise InputError(f"frame {number}", problem, remedy)

    def _report_progress(self, stage: str, fraction: float) -> None:
        if self.run.stop.is_set():
            raise AbortedError(f"{self.name} was stopped")
        self.run.report_progress(self.name, stage, fraction)

    @contextmanager
    def _timed(self, stage: str, last: Filter | None = None) -> Iterator[None]:
        """Add the time to a stage, and let the stop flag abort the filters in it."""
        before = self.clock()
        observed = (
            []
            if last is None
            else [(f, f.AddObserver("ProgressEvent", self._on_progress)) for f in _chain(last)]
        )
        try:
            yield
        finally:
            for algorithm, tag in observed:
                algorithm.RemoveObserver(tag)
            self.seconds[stage] = self.seconds.get(stage, 0.0) + self.clock() - before

    def _on_progress(self, algorithm: Any, _event: str) -> None:
        if self.run.stop.is_set():
            algorithm.SetAbortExecute(1)


def muscle_pipeline(
    scene: SceneData,
    name: str,
    *,
    neighbours: Mapping[str, Any] | None = None,
) -> MusclePipeline:
    """Return the filters that a run of a scene sends a muscle through.

    Parameters
    ----------
    scene, name : SceneData, str
        Which muscle, of which scene.
    neighbours : mapping of str to algorithm, optional
        Deformers of the muscles that this one is kept out of.

    Examples
    --------
    >>> from vtkmuscle import Scene, phantoms
    >>> from vtkmuscle.run import muscle_pipeline
    >>> scene = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8)
    >>> pipeline = muscle_pipeline(scene, "spindle")
    >>> pipeline.fibres.update().output.GetNumberOfCells()
    8
    """
    muscle = scene.muscles[name]
    return MusclePipeline(
        muscle.surface,
        scene.bones_data(),  # one per muscle: threads must not share what VTK writes to
        scene.motion,
        scene.attachments_data(name),
        superficial=muscle.superficial_fibres,
        aponeuroses=scene.aponeuroses_data(name),
        neighbours=neighbours,
        model=scene.model,
        fixing=scene.fixing_of(name),
        fibres=muscle.fibres,
        solver=None if scene.model == "paths" else scene.solver_of(name),
    )


def _chain(last: Filter) -> list[Any]:
    """Return an algorithm and all that it depends on, each once."""
    found: list[Any] = []
    waiting: list[Any] = [last]
    while waiting:
        algorithm = waiting.pop()
        if algorithm in found:
            continue
        found.append(algorithm)
        for port in range(algorithm.GetNumberOfInputPorts()):
            indices = range(algorithm.GetNumberOfInputConnections(port))
            waiting.extend(algorithm.GetInputAlgorithm(port, index) for index in indices)
    return found


def _warn_if_none_is_free(name: str, muscle: vtkPolyData) -> None:
    fixed = point_array(muscle, "FixedTo", f"muscles.{name}") >= 0
    if fixed.all():
        warnings.warn(
            f"muscles.{name}: all {len(fixed)} points are fixed to bones: none is free, and nothing is "
            "deformed; check fixing (method, tolerance) and the areas",
            stacklevel=2,
        )


def _add_penetration(
    fibres: vtkPolyData, measure: MuscleMeasure, transforms: Mapping[str, Any]
) -> Floats | None:
    """Add the cell array ``Penetration``: how deep the deepest point of each fibre is in a bone.

    Returns how deep each point of them is, None where no bone has an inside.
    """
    lines = polylines_of(fibres, "fibres")
    depths = measure.depths(lines.points, transforms)
    if depths is not None:
        set_cell_array(fibres, "Penetration", np.maximum.reduceat(depths, lines.offsets[:-1]))
    return depths


def _copy(data: Any) -> Any:
    copy = data.NewInstance()
    copy.ShallowCopy(data)
    return copy
