"""One setting tried on a scene: its muscles over the motion, with time, memory and shape of each frame."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.data.arrays import cell_array, field_array, points_of
from vtkmuscle.data.surface_distance import SurfaceDistance
from vtkmuscle.filters.fibre_metrics import FibreMetrics
from vtkmuscle.filters.fibre_transport import FibreTransport
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.pipelines import decompose, deform
from vtkmuscle.run.measure import MuscleMeasure
from vtkmuscle.scene.data import SceneData
from vtkmuscle.tradeoff.memory import peak_memory
from vtkmuscle.tradeoff.settings import Setting

Floats = NDArray[np.float64]

#: Parameters of PBDDeformer that trade speed for accuracy. The scene's own values of these do not count, so
#: that the reference is the reference; all others, such as stiffnesses, are the scene's.
TRADED = ("dtype", "grid_spacing", "iterations", "order", "solver", "start", "substeps", "tolerance")

#: Part of the frames left out at either end of their times, in the mean.
_TRIMMED = 0.1


@dataclass(eq=False)
class MuscleTrial:
    """What became of a muscle.

    Attributes
    ----------
    points : (f, n, 3) array
        In the frames that are compared.
    lengths : (f, k) array
        Of the fibres in these frames [mm]; k is 0 for a muscle without fibres.
    frames : list of dict
        Shape figures of these frames.
    ms, fibre_ms : float
        Processor time of a frame: deforming the muscle, and carrying and measuring its fibres.
    fibres_s : float
        Processor time of filling it with fibres [s].
    """

    points: Floats
    lengths: Floats
    frames: list[dict[str, Any]]
    ms: float
    fibre_ms: float
    fibres_s: float


@dataclass(eq=False)
class Trial:
    """What became of a scene.

    Attributes
    ----------
    muscles : dict of str to MuscleTrial
        By name.
    memory_mb : float or None
        What the run added to the memory in use, at its peak.
    """

    muscles: dict[str, MuscleTrial]
    memory_mb: float | None


@dataclass(eq=False)
class Bench:
    """A scene on which settings are tried: what does not depend on the setting is made once.

    Attributes
    ----------
    scene : SceneData
        What is run.
    muscles : sequence of str
        Which of its muscles.
    compared : sequence of int
        Numbers of the frames that are compared; all up to the last of them are computed.
    tell : callable
        Told what is being done.
    """

    scene: SceneData
    muscles: Sequence[str]
    compared: Sequence[int]
    tell: Callable[[str], None] = lambda words: None
    _fixed: dict[str, vtkPolyData] = field(default_factory=dict)
    _fibres: dict[str, tuple[vtkPolyData, float]] = field(default_factory=dict)
    _distances: dict[str, SurfaceDistance] = field(default_factory=dict)

    def run(self, setting: Setting, only: Sequence[str] | None = None) -> Trial:
        """Return what becomes of the scene, or of some of its muscles, with a setting."""
        muscles, names = {}, self.muscles if only is None else only
        for name in names:  # not part of the run's memory
            self._at_rest(name)
            self._filled(name, setting)
        with peak_memory() as peak:
            for name in names:
                self.tell(f"{setting.name}: {name}")
                muscles[name] = self._deformed(name, setting)
        return Trial(muscles, peak.megabytes)

    def _at_rest(self, name: str) -> vtkPolyData:
        """Return a muscle with its fixed points."""
        if name not in self._fixed:
            detector = FixedPointDetector(**self.scene.fixing_of(name))
            inputs = self.scene.muscles[name].surface, self.scene.bones_data()
            for port, value in enumerate((*inputs, self.scene.attachments_data(name))):
                detector.connect(port, value)
            self._fixed[name] = detector.update().output
        return self._fixed[name]

    def _filled(self, name: str, setting: Setting) -> tuple[vtkPolyData | None, float]:
        """Return a muscle's fibres, and the time they took [s]."""
        own = self.scene.muscles[name].fibres
        if own is None:
            return None, 0.0
        settings = {**own, **setting.fibres}
        key = f"{name} {sorted(settings.items())}"
        if key not in self._fibres:
            before = time.process_time()
            fibres = decompose(self._at_rest(name), self.scene.attachments_data(name), **settings)
            self._fibres[key] = fibres.update().output, time.process_time() - before
        return self._fibres[key]

    def _measure(self, name: str) -> MuscleMeasure:
        scene = self.scene
        if not self._distances:
            self._distances = {bone: SurfaceDistance(surface) for bone, surface in scene.bones.items()}
        return MuscleMeasure(self._at_rest(name), list(scene.bones), self._distances, scene.millimetres)

    def _deformed(self, name: str, setting: Setting) -> MuscleTrial:
        scene = self.scene
        rest = self._at_rest(name)
        fibres, fibres_s = self._filled(name, setting)
        motion = thinned(scene.motion, setting.every, self.compared[-1])
        own = {**scene.solver, **scene.muscles[name].solver}
        solver = {**{key: own[key] for key in own if key not in TRADED}, **setting.solver}
        deformer = deform(rest, scene.bones_data(), motion, fibres=fibres, fixing=None, **solver)
        transport, metrics = FibreTransport(weight_tolerance=setting.weight_tolerance), FibreMetrics()
        if fibres is not None:
            for port, data in enumerate((fibres, rest, deformer)):
                transport.connect(port, data)
            for port, data in enumerate((transport, deformer)):
                metrics.connect(port, data)
        measure = self._measure(name)
        compared = {float(scene.motion.times[number]) for number in self.compared}
        points, lengths, rows, took, fibres_took = [], [], [], [], []
        for at in motion.times:
            now = float(at)
            before = time.process_time()
            deformed = deformer.update(time=now).output
            took.append(1e3 * (time.process_time() - before))
            if now not in compared:
                continue
            points.append(points_of(deformed) * scene.millimetres)
            row = measure.frame(points_of(deformed), scene.motion.at(now))
            rows.append({"time": now, **row, **_reported(deformed, scene.millimetres)})
            if fibres is not None:
                before = time.process_time()
                measured = metrics.update(time=now).output
                fibres_took.append(1e3 * (time.process_time() - before))
                length = cell_array(measured, "Length", f"muscles.{name}: fibres")
                lengths.append(np.array(length) * scene.millimetres)
        # The first frame of each makes what the others use.
        ms, fibre_ms = trimmed_mean(took[1:] or took), trimmed_mean(fibres_took[1:] or fibres_took or [0.0])
        none = np.empty((len(rows), 0))
        return MuscleTrial(
            np.array(points), np.array(lengths) if lengths else none, rows, ms, fibre_ms, fibres_s
        )


def thinned(motion: RigidMotion, every: int, last: int) -> RigidMotion:
    """Return each so manieth frame of a motion up to the last one, which is kept in any case."""
    return motion.part(sorted({*range(0, last + 1, every), last}))


def trimmed_mean(values: Sequence[float]) -> float:
    """Return the mean of values without the tenth at either end: what else the machine does is in those."""
    ordered = np.sort(np.asarray(values))
    cut = int(_TRIMMED * len(ordered))
    return float(ordered[cut : len(ordered) - cut].mean())


def _reported(deformed: Any, millimetres: float) -> dict[str, Any]:
    """Return what the deformer says of a frame."""
    found: dict[str, Any] = {}
    names = {"DihedralErrorP95": "dihedral_error_p95", "Iterations": "iterations"}
    for array, name in names.items():
        values = field_array(deformed, array)
        found[name] = None if values is None else float(values[0])
    estimate = field_array(deformed, "EstimatedDistance")
    found["estimated_mm"] = None if estimate is None else float(estimate[0]) * millimetres
    return found
