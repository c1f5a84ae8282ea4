"""A muscle's run through a scene."""

import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.errors import InputError, fault_of
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.types import Floats
from vtkmuscle.data import arrays
from vtkmuscle.data.attachments import VIA
from vtkmuscle.data.paths import PASSED, PATH_STEPS, SAG, SQUEEZED, UNSETTLED, path_lines_of, paths_of
from vtkmuscle.filters import Filter, PathDeformer, PBDDeformer, TautPaths
from vtkmuscle.filters.base.algorithm import AbortedError
from vtkmuscle.filters.base.running import upstream
from vtkmuscle.filters.deformer import read_shape
from vtkmuscle.io.fibre_table import spread
from vtkmuscle.pipelines import MusclePipeline
from vtkmuscle.run.frames import MuscleTrack, RunOptions
from vtkmuscle.run.measure import MuscleMeasure
from vtkmuscle.run.report_values import architecture_of, fibres_at_rest, measures_of_fibres
from vtkmuscle.run.store.writing import ResultWriter
from vtkmuscle.run.verdict import judge, reasons_of, with_reasons
from vtkmuscle.scene.data import Anatomy, SceneData


@dataclass(frozen=True, eq=False)
class SceneRun:
    """The data shared by the muscles of a run.

    ``numbers`` are the kept frames; ``stop`` ends the run early, and files are written once ``checked`` is
    set. ``only`` is the single computed output, None for all.
    """

    scene: SceneData
    numbers: range
    store: ResultWriter | None
    options: RunOptions
    only: str | None = None
    stop: threading.Event = field(default_factory=threading.Event)
    checked: Any = field(default_factory=threading.Event)

    @cached_property
    def bones(self) -> Mapping[str, Bone]:
        """The bones with an inside, at rest."""
        return Anatomy.of(self.scene).solid_bones

    def report_progress(self, muscle: str, stage: str, fraction: float) -> None:
        """Call the observer of the progress."""
        if self.options.progress is not None:
            self.options.progress(muscle, stage, fraction)


class MuscleRun:
    """A muscle run: fixed points, fibres, frames, verdict.

    Finished frames go to ``track``. ``others`` are the possible contact partners with finished runs. Overlap
    with ``others`` is measured, and with ``muscle_contact`` ``"on"`` the muscle is kept out of ``others``.
    """

    def __init__(self, run: SceneRun, name: str, neighbours: Sequence["MuscleRun"] = ()) -> None:
        self.run, self.scene, self.clock = run, run.scene, run.options.clock
        self.name, self.track, self.neighbours = name, MuscleTrack(), neighbours
        self.deformer: PathDeformer | PBDDeformer | None = None
        self.seconds: dict[str, float] = {}
        self.track.report["seconds"] = self.seconds

    def go(self) -> None:
        """Run all stages; a stopped run raises an AbortedError and keeps its complete frames."""
        scene, track, last = self.scene, self.track, self.run.numbers[-1] + 1
        areas = scene.muscles[self.name].attachments
        track.report["via_rings"] = sum(area.role == VIA for area in areas)
        if self.run.only is not None:
            self._compute_only(self.run.only)
            return
        neighbours = self._deformers() if scene.muscle_contact == "on" else None
        pipeline = muscle_pipeline(scene, self.name, neighbours=neighbours)
        self.deformer = pipeline.deformer
        if self.deformer is not None:
            self.deformer.measure_shape = True
        self._report_progress("fixed points", 0.0)
        with self._timed("fixing", pipeline.fixed):
            rest = track.rest = pipeline.fixed.update().output
        if (fixed := arrays.point_array(rest, "FixedTo", f"muscles.{self.name}") >= 0).all():
            words = f"muscles.{self.name}: all {len(fixed)} points are fixed to bones, and no point is "
            warnings.warn(f"{words}deformed; check fixing (method, tolerance) and the areas", stacklevel=2)
        with self._timed("measuring"):
            measure = MuscleMeasure(rest, list(scene.bones), self.run.bones, scene.millimetres)
        confidence = [area.confidence for area in areas if area.confidence is not None]
        track.report |= measure.at_rest()
        track.report["estimated_attachments"] = sum(area.estimated for area in areas)
        track.report["attachment_confidence"] = min(confidence, default=None)
        if pipeline.fibres is not None:
            self._fill(rest, pipeline.fibres, measure)
        stages = {"paths": pipeline.taut_paths, "solver": pipeline.deformer, "fixing": pipeline.fixed}
        parameters = {name: stage.parameters() for name, stage in stages.items() if stage is not None}
        fibres = scene.muscles[self.name].fibres
        parameters["fibres"] = None if fibres is None else dict(fibres)
        track.report |= {"parameters": parameters, "frames": []}
        self.run.checked.wait()
        for number in self.run.numbers:
            self._report_progress("pulling paths" if self.deformer is None else "deforming", number / last)
            self._compute(number, pipeline, measure)
            if track.failure is not None:
                break
        self._judge(measure, pipeline)
        if self.run.store is not None:
            with self._timed("writing"):
                self.run.store.finish(self.name, track)
        if scene.muscle_contact == "off":
            self.deformer = None  # no later muscle asks it for its frames
        self._report_progress("done", 1.0)

    def _compute_only(self, output: str) -> None:
        """Compute the lengths, moment arms or surfaces of all frames alone."""
        pipeline, track, last = muscle_pipeline(self.scene, self.name), self.track, self.run.numbers[-1] + 1
        taut, deformer = pipeline.taut_paths, pipeline.deformer
        rows: list[dict[str, Any]] = track.report.setdefault("frames", [])
        if taut is not None:
            taut.levers, taut.bows = output == "moment_arms", output == "lengths"
        for number in self.run.numbers:
            self._report_progress("pulling paths" if deformer is None else "deforming", number / last)
            now = float(self.scene.motion.times[number])
            if deformer is not None:
                track.surfaces.append(arrays.shallow_copy(deformer.update(time=now).output))
                continue
            paths = None if taut is None else path_lines_of(taut.update(time=now).output, self.name)
            if paths is None:
                raise InputError(f"muscles.{self.name}", "the muscle has no paths", "add fibres")
            rows.append({"frame": number, "time": now} | _settling(pipeline) | self._add_lengths(paths.data))
        if rows:  # a whole run has a verdict
            surface = arrays.checked_surface(self.scene.muscles[self.name].surface, f"muscles.{self.name}")
            size = self.scene.millimetres * float(np.cbrt(abs(signed_volume(*surface))))
            motion = self.scene.motion.part(self.run.numbers)
            for reason in reasons_of(judge(track, track.rest_lengths, motion=motion, size=size)):
                warnings.warn(f"muscles.{self.name}: {reason}", stacklevel=2)
        self._report_progress("done", 1.0)

    def _fill(self, rest: vtkPolyData, source: Filter, measure: MuscleMeasure) -> None:
        """Fill the muscle with fibres, measured at rest."""
        scene, track = self.scene, self.track
        self._report_progress("fibres", 0.0)
        with self._timed("fibres", source):
            fibres = track.rest_fibres = source.update().output
        with self._timed("measuring"):
            lines = arrays.polylines_of(fibres, "fibres")
            measure.take_fibres_at_rest(lines.points, lines.offsets)
            own, scale = scene.muscles[self.name], scene.millimetres
            named, between = own.muscle or self.name, bool(own.aponeuroses)
            track.report["fibres"] = fibres_at_rest(fibres, rest, scale)
            shape = architecture_of(fibres, rest, scale, own.hill, named, between_aponeuroses=between)
            track.report |= {"architecture": shape, "fibre_measures": []}

    def _compute(self, number: int, pipeline: MusclePipeline, measure: MuscleMeasure) -> None:
        """Compute, measure and keep the muscle in a frame."""
        now = float(self.scene.motion.times[number])
        transforms, row = self.scene.motion.at(now), {"frame": number, "time": now}
        deformed = fibres = None
        if pipeline.deformer is not None:
            try:
                with self._timed("deforming", pipeline.deformer) as took:
                    deformed = pipeline.deformer.update(time=now).output
                points = arrays.points_of(deformed)
                if not np.isfinite(points).all():
                    remedy = "lower the stiffnesses, or use smaller steps"
                    problem = "the deformed muscle has coordinates that are not finite"
                    raise InputError(f"frame {number}", problem, remedy)
            except ValueError as error:
                # In the first frame the input is wrong; later the muscle has gone astray.
                if number == 0:
                    raise
                self.track.failure = number, now, error
                return
        if pipeline.metrics is not None:
            stage = "pulling paths" if deformed is None else "carrying fibres"
            with self._timed(stage, pipeline.metrics) as carried:
                fibres = arrays.shallow_copy(pipeline.metrics.update(time=now).output)
        with self._timed("measuring"):
            depths = None if fibres is None else _add_depths(fibres, measure, transforms)
            paths = None if fibres is None else paths_of(fibres, "fibres")
            if paths is not None:
                rings = [area for area in self.scene.muscles[self.name].attachments if area.role == VIA]
                row["hooked_paths"] = measure.hooked_paths(paths.points, rings, transforms)
            if deformed is None:
                self._keep(row | _settling(pipeline) | {"ms": 1000.0 * carried()}, None, fibres)
                return
            row |= read_shape(deformed, self.scene.millimetres) | _settling(pipeline)
            row |= measure.frame(points, transforms)
            if fibres is not None:
                lines = arrays.polylines_of(fibres, "fibres")
                row |= measure.fibres(lines.points, lines.offsets, points, depths)
                row["ms_fibres"] = 1000.0 * carried()
        if self.scene.muscle_contact != "off":
            with self._timed("measuring overlap"):
                surfaces = (other.update(time=now).output for other in self._deformers().values())
                row |= measure.overlap(points, surfaces)
        self._keep(row | {"ms": 1000.0 * took()}, deformed, fibres)

    def _keep(self, row: dict[str, Any], deformed: vtkPolyData | None, fibres: vtkPolyData | None) -> None:
        """Keep a frame, all or nothing, in files if the run has a folder, else in memory."""
        number, now = row["frame"], row["time"]
        kept: tuple[Any, Any] = None, fibres
        if self.run.store is not None:
            with self._timed("writing"):
                kept = self.run.store.write_frame(self.name, number, deformed, fibres)
        elif deformed is not None:
            kept = arrays.with_points(self.track.rest, arrays.points_of(deformed)), fibres
        for frames, frame in zip((self.track.surfaces, self.track.fibres), kept, strict=True):
            if frame is not None:
                frames.append(frame)
        if fibres is not None:
            row |= self._add_lengths(fibres)
            measures = measures_of_fibres(self.track.numbers[-1][0], self.scene.millimetres)
            sizes = {name: spread(values) for name, values in measures.items()}
            self.track.report["fibre_measures"].append({"frame": number, "time": now, **sizes})
        self.track.report["frames"].append(row)

    def _add_lengths(self, fibres: vtkPolyData) -> dict[str, float]:
        """Keep the lengths of fibres. Return the paths' columns of a frame."""
        self.track.add_lengths(fibres, self.scene.millimetres)
        names = [name for name in (SQUEEZED, SAG) if fibres.GetCellData().HasArray(name)]
        depths = {name: np.percentile(arrays.cell_array(fibres, name, "fibres"), 95) for name in names}
        return {f"{name.lower()}_p95_mm": float(d) * self.scene.millimetres for name, d in depths.items()}

    def _judge(self, measure: MuscleMeasure, pipeline: MusclePipeline) -> None:
        """Add the verdict on the computed frames to the report."""
        track, computed, rest = self.track, self.run.numbers[: len(self.track.report["frames"])], None
        motion = self.scene.motion.part(computed) if computed else None
        missing: dict[str, str] = {}
        if track.rest_fibres is not None and track.fibre_lengths:
            rest = arrays.polylines_of(track.rest_fibres, "fibres").lengths * self.scene.millimetres
            try:
                with self._timed("checking", pipeline.few_paths):
                    self._compare_with_paths(rest, pipeline.few_paths)
            except ValueError as error:
                missing["fibres and paths"] = fault_of(error, placed=True)[0]
        sizes: dict[str, Any] = {"n_edges": measure.n_edges, "size": measure.size}
        track.report["verdict"] = with_reasons(judge(track, rest, motion=motion, **sizes), (), missing)

    def _compare_with_paths(self, rest: Floats, few_paths: TautPaths) -> None:
        """Add to the frames how much more or less than taut paths the fibres have lengthened.

        Without paths in the frames, those of the longest, shortest and most bowed fibres, and the last, are
        compared with few paths.
        """
        track, rows, millimetres = self.track, self.track.report["frames"], self.scene.millimetres
        lengths, rest_paths = np.mean(track.fibre_lengths, axis=1), track.rest_lengths
        taut = dict(enumerate(track.lengths))
        if not taut:
            bows = [numbers["Tortuosity"].mean() for numbers, _ in track.numbers]
            for at in sorted({lengths.argmin(), lengths.argmax(), np.argmax(bows), len(rows) - 1}):
                if (paths := paths_of(few_paths.update(time=rows[at]["time"]).output, "paths")) is not None:
                    taut[int(at)], rest_paths = (millimetres * each for each in paths[:2])
        for at, of_frame in taut.items():
            more = lengths[at] - rest.mean() - (of_frame.mean() - rest_paths.mean())
            if np.isfinite(more):
                rows[at]["lengthening_error"] = float(abs(more) / of_frame.mean())

    def _deformers(self) -> dict[str, PathDeformer | PBDDeformer]:
        """Return the deformers of other muscles without failure."""
        whole = [other for other in self.neighbours if other.track.failure is None]
        return {other.name: other.deformer for other in whole if other.deformer is not None}

    def _report_progress(self, stage: str, fraction: float) -> None:
        if self.run.stop.is_set():
            raise AbortedError(f"{self.name} was stopped")
        self.run.report_progress(self.name, stage, fraction)

    @contextmanager
    def _timed(self, stage: str, last: Filter | None = None) -> Iterator[Callable[[], float]]:
        """Add the time to a stage. The stop flag aborts its filters; yields a function for the time."""
        before = after = self.clock()
        chain = () if last is None else upstream(last)
        observed = [(each, each.AddObserver("ProgressEvent", self._on_progress)) for each in chain]
        try:
            yield lambda: after - before
        finally:
            for algorithm, tag in observed:
                algorithm.RemoveObserver(tag)
            after = self.clock()
            self.seconds[stage] = self.seconds.get(stage, 0.0) + after - before

    def _on_progress(self, algorithm: Any, _event: str) -> None:
        if self.run.stop.is_set():
            algorithm.SetAbortExecute(1)


#: Columns of a frame in the report, and the field arrays of paths that they are from.
_SETTLING = {"unsettled": UNSETTLED, "path_steps": PATH_STEPS, "passed_paths": PASSED}


def muscle_pipeline(
    scene: SceneData, name: str, *, neighbours: Mapping[str, Any] | None = None
) -> MusclePipeline:
    """Return the chained filters of a muscle of a scene.

    ``neighbours`` are the deformers by name of the muscles to keep out of.

    Examples
    --------
    >>> from vtkmuscle import Scene, phantoms
    >>> from vtkmuscle.run import muscle_pipeline
    >>> scene = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8)
    >>> pipeline = muscle_pipeline(scene, "spindle")
    >>> pipeline.fibres.update().output.GetNumberOfCells()
    8
    """
    muscle, motion = scene.muscles[name], scene.motion
    if muscle.crosses is not None:  # nobody asks for moment arms by others
        motion = motion.by([name for name in motion.coordinates if name in muscle.crosses])
    solver = None if scene.deformer == "none" else scene.solver_of(name)
    settings: dict[str, Any] = {key: getattr(scene, key) for key in ("deformer", "quality", "paths")}
    settings |= {"fibres": muscle.fibres, "fixing": scene.fixing_of(name), "solver": solver}
    settings |= {"superficial": muscle.superficial_fibres, "aponeuroses": scene.aponeuroses_data(name)}
    bones, areas = scene.bones_data(), scene.attachments_data(name)  # each muscle's own: VTK writes to them
    return MusclePipeline(muscle.surface, bones, motion, areas, neighbours=neighbours, **settings)


def _settling(pipeline: MusclePipeline) -> dict[str, float]:
    """Return the columns of :data:`_SETTLING` of the last frame; empty without paths."""
    if pipeline.taut_paths is None:
        return {}
    output = pipeline.taut_paths.GetOutputDataObject(0)
    values = {name: arrays.field_array(output, of) for name, of in _SETTLING.items()}
    return {name: value[0].item() for name, value in values.items() if value is not None}


def _add_depths(fibres: vtkPolyData, measure: MuscleMeasure, transforms: Mapping[str, Any]) -> Floats | None:
    """Add the depth of each fibre in bones as ``Penetration``; return the depths of points, or None."""
    lines = arrays.polylines_of(fibres, "fibres")
    depths = measure.depths(lines.points, transforms)
    if depths is not None:
        arrays.add_arrays(fibres, cells={"Penetration": np.maximum.reduceat(depths, lines.offsets[:-1])})
    return depths
