"""One muscle's run through a scene."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData
from vtkmodules.vtkFiltersGeneral import vtkGroupDataSetsFilter

from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.data.arrays import (
    cell_array,
    field_array,
    multiblock_from,
    points_of,
    polylines_of,
    set_cell_array,
)
from vtkmuscle.data.surface_distance import SurfaceDistance
from vtkmuscle.filters.base.filter import AbortedError, Filter
from vtkmuscle.filters.deformer.convergence_report import read_convergence
from vtkmuscle.filters.fibre_metrics import FibreMetrics
from vtkmuscle.filters.fibre_transport import FibreTransport
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.filters.pbd_deformer import NEIGHBOURS, PBDDeformer
from vtkmuscle.pipelines import TRANSPORT_SETTINGS, WEIGHT_TOLERANCE, decompose, deform, pull_taut
from vtkmuscle.run.fixed_points import warn_of_fixed_points
from vtkmuscle.run.folder import RunFolder
from vtkmuscle.run.measure import MuscleMeasure
from vtkmuscle.run.report import architecture_of, fibres_at_rest, measures_of_fibres
from vtkmuscle.run.result import MuscleTrack
from vtkmuscle.run.verdict import judge, slackness_of
from vtkmuscle.scene.data import SceneData

Progress = Callable[[str, str, float], None]
Observe = Callable[[str, Mapping[str, Any]], None]


class MuscleRun:
    """One muscle's way through all stages: fixed points, fibres, and per frame deformation and fibres.

    Parameters
    ----------
    scene : SceneData
        What the muscle belongs to.
    name : str
        Which muscle.
    track : MuscleTrack
        Where finished frames go.
    bones : dict of str to vtkPolyData
        Of the scene, at rest, with what :func:`~vtkmuscle.run.reach.bones_with_reach` adds.
    distances : dict of str to SurfaceDistance
        Of the closed bones.
    folder : RunFolder or None
        Where to write to.
    stop : threading.Event
        Set from outside to end the run early.
    progress : callable
        Told the muscle, the stage and the part that is done.
    observe : callable
        Told the muscle and the figures of each frame that is done.
    others : sequence of MuscleRun, optional
        Muscles that this one may meet, whose runs are done: overlap with them is measured, and where the
        scene's ``muscle_contact`` is ``"on"`` this muscle is kept out of them.
    """

    def __init__(
        self,
        scene: SceneData,
        name: str,
        track: MuscleTrack,
        bones: dict[str, vtkPolyData],
        distances: dict[str, SurfaceDistance],
        folder: RunFolder | None,
        stop: threading.Event,
        progress: Progress,
        observe: Observe,
        others: Sequence[MuscleRun] = (),
    ) -> None:
        self.observe = observe
        self.scene, self.name, self.track = scene, name, track
        self.bones, self.distances, self.folder = bones, distances, folder
        self.stop, self.progress = stop, progress
        self.others = others
        self.deformer: PBDDeformer | None = None
        self.seconds: dict[str, float] = {}
        track.report["seconds"] = self.seconds

    def go(self, numbers: range) -> None:
        """Run all stages, and keep the frames of these numbers.

        Raises
        ------
        AbortedError
            If it was stopped; the frames before are complete.
        """
        scene, name, track = self.scene, self.name, self.track
        muscle, attachments = scene.muscles[name], scene.attachments_data(name)
        detector = FixedPointDetector(**scene.fixing_of(name))
        for port, value in enumerate((muscle.surface, scene.bones_data(), attachments)):
            detector.connect(port, value)
        self._tell("fixed points", 0.0)
        with self._timed("fixing", detector):
            track.rest = detector.update().output
        warn_of_fixed_points(name, track.rest)
        with self._timed("measuring"):
            measure = MuscleMeasure(track.rest, list(scene.bones), self.distances, scene.millimetres)
            track.report.update(measure.at_rest())
        track.report["estimated_attachments"] = sum(area.estimated for area in muscle.attachments)
        fibres, carried = None, {"weight_tolerance": WEIGHT_TOLERANCE}
        if muscle.fibres is not None:
            carried |= {word: muscle.fibres[word] for word in TRANSPORT_SETTINGS if word in muscle.fibres}
            shaped = {word: value for word, value in muscle.fibres.items() if word not in TRANSPORT_SETTINGS}
            fibres = decompose(detector, attachments, superficial=muscle.superficial_fibres, **shaped)
        if fibres is not None:
            self._tell("fibres", 0.0)
            with self._timed("fibres", fibres):
                track.rest_fibres = fibres.update().output
            with self._timed("measuring"):
                rested = polylines_of(track.rest_fibres, "fibres")
                measure.take_fibres_at_rest(rested.points, rested.offsets)
                inside = fibres_at_rest(track.rest_fibres, track.rest, scene.millimetres)
                track.report["fibres"] = inside
                track.report["architecture"] = architecture_of(
                    track.rest_fibres, track.rest, attachments, scene.millimetres
                )
            track.report["fibre_measures"] = []
        bones = multiblock_from(self.bones)  # of its own: threads must not share what VTK writes to
        if scene.model == "paths":
            self._pull(numbers, detector, bones, fibres, measure)
            return
        solver = scene.solver_of(name)
        deformer = deform(
            detector,
            bones,
            scene.motion,
            fibres=fibres,
            attachments=attachments,
            superficial=muscle.superficial_fibres,
            fixing=None,
            **solver,
        )
        self.deformer = deformer
        if self._whole_others() and scene.muscle_contact == "on":
            deformer.connect(NEIGHBOURS, self._grouped_others())
        track.report["parameters"] = {
            "solver": deformer.parameters(),
            "fixing": detector.parameters(),
            "fibres": None if muscle.fibres is None else {**muscle.fibres, **carried},
        }
        track.report["frames"] = []
        transport, metrics = _carried(detector, fibres, deformer, carried)
        for number in range(numbers[-1] + 1):
            self._tell("deforming", number / (numbers[-1] + 1))
            self._frame(number, number in numbers, deformer, transport, metrics, measure)
            if track.failure is not None:
                break
        self._judge(numbers, measure)
        if self.folder is not None:
            with self._timed("writing"):
                self.folder.finish(self.name)
        self._tell("done", 1.0)

    def _pull(
        self,
        numbers: range,
        detector: FixedPointDetector,
        bones: vtkMultiBlockDataSet,
        fibres: Filter | None,
        measure: MuscleMeasure,
    ) -> None:
        """Run model ``"paths"``: the fibres pulled taut in each frame, and nothing else."""
        attachments = self.scene.attachments_data(self.name)
        taut = pull_taut(detector, bones, self.scene.motion, fibres, attachments, fixing=None)
        metrics = FibreMetrics(curvature=True)
        metrics.connect(0, taut)
        self.track.report["parameters"] = {
            "solver": taut.parameters(),
            "fixing": detector.parameters(),
            "fibres": dict(self.scene.muscles[self.name].fibres or {}),
        }
        self.track.report["frames"] = []
        for number in numbers:
            self._tell("pulling fibres", number / (numbers[-1] + 1))
            now = float(self.scene.motion.times[number])
            before = time.perf_counter()
            with self._timed("pulling fibres", metrics):
                found = _copy(metrics.update(time=now).output)
            took = time.perf_counter() - before
            _add_penetration(found, measure, self.scene.motion.at(now))
            unsettled = field_array(found, "UnsettledFibres")
            row = {
                "frame": number,
                "time": now,
                "unsettled_fibres": 0 if unsettled is None else int(unsettled[0]),
            }
            self._keep(row | {"ms": 1000.0 * took}, None, found)
        self._judge(numbers, measure)
        if self.folder is not None:
            self.folder.finish(self.name)
        self._tell("done", 1.0)

    def _frame(
        self,
        number: int,
        wanted: bool,
        deformer: PBDDeformer,
        transport: Filter | None,
        metrics: Filter | None,
        measure: MuscleMeasure,
    ) -> None:
        now = float(self.scene.motion.times[number])
        before = time.perf_counter()
        try:
            with self._timed("deforming", deformer):
                deformed = deformer.update(time=now).output
            self._check_finite(points_of(deformed), number)
        except ValueError as error:
            # In the first frame it is what was given that is wrong; later the muscle has gone astray.
            if number == 0:
                raise
            self.track.failure = number, now, error
            return
        took = time.perf_counter() - before
        if not wanted:
            return
        points = points_of(deformed)
        fibres = None
        if transport is not None and metrics is not None:
            with self._timed("transport", transport):
                transport.update(time=now)
            with self._timed("metrics", metrics):
                fibres = _copy(metrics.update(time=now).output)
                _add_penetration(fibres, measure, self.scene.motion.at(now))
        with self._timed("measuring"):
            row = {
                "frame": number,
                "time": now,
                **read_convergence(deformed, self.scene.millimetres),
                **measure.frame(points, self.scene.motion.at(now)),
            }
            if fibres is not None:
                lines = polylines_of(fibres, "fibres")
                row |= measure.fibres(lines.points, lines.offsets, points, self.scene.motion.at(now))
        if self.scene.muscle_contact != "off":
            with self._timed("measuring overlap"):
                row.update(measure.overlap(points, self._others_at(now)))
        row["ms"] = 1000.0 * took
        self._keep(row, deformed, fibres)

    def _keep(self, row: dict[str, Any], deformed: vtkPolyData | None, fibres: vtkPolyData | None) -> None:
        """Write a frame and keep it: all of it is there then, or nothing."""
        number, now = row["frame"], row["time"]
        if self.folder is not None:
            with self._timed("writing"):
                self.folder.write_frame(self.scene, self.name, number, now, deformed, fibres)
        if deformed is not None:
            self.track.points.append(points_of(deformed))
        if fibres is not None:
            lengths = cell_array(fibres, "Length", f"muscles.{self.name}: fibres")
            self.track.lengths.append(np.array(lengths) * self.scene.millimetres)
            self.track.fibres.append(fibres)
            measures = measures_of_fibres(fibres, self.scene.millimetres)
            self.track.report["fibre_measures"].append({"frame": number, "time": now, **measures})
        self.track.report["frames"].append(row)
        self.observe(self.name, row)

    def _judge(self, numbers: range, measure: MuscleMeasure) -> None:
        """Add the verdict on the frames that are there to the report."""
        track, millimetres = self.track, self.scene.millimetres
        rows = track.report["frames"]
        tolerance = track.report["parameters"]["solver"].get("tolerance")
        lengths = rest_lengths = slackness = None
        if track.lengths and track.rest_fibres is not None:
            lines = polylines_of(track.rest_fibres, "fibres")
            lengths, rest_lengths = np.array(track.lengths), polyline_lengths(lines.points, lines.offsets)
            rest_lengths = rest_lengths * millimetres
            slackness = slackness_of(track.fibres, track.lengths, track.rest_fibres, millimetres)
        track.report["verdict"] = judge(
            rows,
            lengths=lengths,
            rest_lengths=rest_lengths,
            slackness=slackness,
            motion=self.scene.motion.part(numbers[: len(rows)]) if rows else None,
            n_edges=measure.n_edges,
            size=measure.size,
            tolerance=None if tolerance is None else tolerance * millimetres,
            failure=track.failure,
        )

    def _grouped_others(self) -> vtkGroupDataSetsFilter:
        group = vtkGroupDataSetsFilter()
        group.SetOutputTypeToMultiBlockDataSet()
        for number, other in enumerate(self._whole_others()):
            assert other.deformer is not None
            group.AddInputConnection(other.deformer.GetOutputPort())
            group.SetInputName(number, other.name)
        return group

    def _whole_others(self) -> list[MuscleRun]:
        """Return the other muscles, without those that failed on the way."""
        return [other for other in self.others if other.track.failure is None]

    def _others_at(self, now: float) -> Iterator[Any]:
        for other in self._whole_others():
            assert other.deformer is not None
            yield other.deformer.update(time=now).output

    def _check_finite(self, points: Any, number: int) -> None:
        if not np.isfinite(points).all():
            raise ValueError(
                f"frame {number}: the deformed muscle has coordinates that are not finite; lower the "
                "stiffnesses, or use smaller steps of the motion"
            )

    def _tell(self, stage: str, fraction: float) -> None:
        if self.stop.is_set():
            raise AbortedError(f"{self.name} was stopped")
        self.progress(self.name, stage, fraction)

    @contextmanager
    def _timed(self, stage: str, last: Filter | None = None) -> Iterator[None]:
        """Add the time to a stage, and let the stop flag abort the filters in it."""
        before = time.perf_counter()
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
            self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - before

    def _on_progress(self, algorithm: Any, _event: str) -> None:
        if self.stop.is_set():
            algorithm.SetAbortExecute(1)


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


def _carried(
    rest: Filter, fibres: Filter | None, deformer: PBDDeformer, settings: dict[str, Any]
) -> tuple[FibreTransport | None, FibreMetrics | None]:
    """Return the filters that carry the fibres with the muscle and measure them."""
    if fibres is None:
        return None, None
    transport, metrics = FibreTransport(**settings), FibreMetrics(curvature=True)
    for port, algorithm in enumerate((fibres, rest, deformer)):
        transport.connect(port, algorithm)
    for port, algorithm in enumerate((transport, deformer)):
        metrics.connect(port, algorithm)
    return transport, metrics


def _add_penetration(fibres: vtkPolyData, measure: MuscleMeasure, transforms: Mapping[str, Any]) -> None:
    """Add the cell array ``Penetration``: how deep the deepest point of each fibre is in a bone."""
    lines = polylines_of(fibres, "fibres")
    depths = measure.depths(lines.points, transforms)
    if depths is not None:
        set_cell_array(fibres, "Penetration", np.maximum.reduceat(depths, lines.offsets[:-1]))


def _copy(data: Any) -> Any:
    copy = data.NewInstance()
    copy.ShallowCopy(data)
    return copy
