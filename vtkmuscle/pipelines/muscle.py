"""All stages of one muscle, connected: fixed points, fibres, deformation, transport and metrics."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.filters.base import Parameter
from vtkmuscle.filters.bone_motion import BoneMotion
from vtkmuscle.filters.fibre_metrics import FibreMetrics
from vtkmuscle.filters.fibre_transport import FibreTransport
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.filters.pbd_deformer import PBDDeformer
from vtkmuscle.filters.taut_fibres import TautFibres
from vtkmuscle.pipelines.fibres import decompose

#: Settings of fibres that are not of :func:`decompose`, but of their transport with the muscle.
TRANSPORT_SETTINGS: dict[str, Parameter[Any]] = {
    "weight_tolerance": FibreTransport.parameter_declarations["weight_tolerance"]
}
#: ``weight_tolerance`` in scenes. For 1600 points in 9878 vertices it keeps 14 MB of weights instead of 126,
#: and a frame takes 4 ms instead of 24 to 48; in a muscle bent by a radian the error of points is 0.008 mm,
#: at most 0.03 mm (``benchmarks/bench_fibres.py --transport``).
WEIGHT_TOLERANCE = 0.3


class MusclePipeline:
    """One muscle's filters, from its surface at rest to the measures of its fibres in motion.

    Nothing is computed before a stage is asked for its output: ``pipeline.deformer.update(time=30.0).output``
    is the muscle, ``pipeline.metrics.update(time=30.0).output`` its fibres with their measures.

    Parameters
    ----------
    surface : vtkPolyData or algorithm
        Closed surface of triangles, in the rest pose.
    bones : vtkMultiBlockDataSet or algorithm
        Named blocks, in the rest pose.
    motion : RigidMotion
        How the bones move.
    attachments : vtkMultiBlockDataSet or algorithm, optional
        Where the muscle is attached, and the via rings that it passes through.
    superficial : vtkPolyData or algorithm, optional
        A few fibres that are seen on the surface at rest: they orient the template.
    neighbours : mapping of str to algorithm, optional
        Deformers of other muscles, out of which this one is kept.
    model : str, optional
        ``"volume"``, which deforms the muscle and moves its fibres with it; or ``"paths"``, which pulls the
        fibres alone taut round the bones.
    fixing : mapping or None, optional
        Parameters of FixedPointDetector; None for a surface that has the point array ``FixedTo`` already.
    aponeuroses : vtkMultiBlockDataSet or algorithm, optional
        Surfaces that the fibres end on, on the muscle or within it: fibres between them move with the muscle.
        Its paths still go from bone to bone.
    fibres : mapping, vtkPolyData, algorithm or None, optional
        Keyword arguments of :func:`decompose` and parameters of FibreTransport (``weight_tolerance``, by
        default :data:`WEIGHT_TOLERANCE`); or fibres at rest; or None for a muscle without fibres.
    solver : mapping, optional
        Parameters of PBDDeformer, or of TautFibres with the model ``"paths"``.

    Attributes
    ----------
    fixed : FixedPointDetector, vtkPolyData or algorithm
        The muscle at rest with the point array ``FixedTo``: the surface itself where ``fixing`` is None.
    paths : vtkPolyData, algorithm or None
        Lines from bone to bone at rest, which are pulled taut and carry the muscle.
    fibres : vtkPolyData, algorithm or None
        Fibres at rest: between the aponeuroses where there are some, else the paths.
    moving : BoneMotion
        The bones in motion.
    deformer : PBDDeformer or None
        The muscle in motion; None with the model ``"paths"``.
    taut : TautFibres or None
        The paths: the fibres in motion with the model ``"paths"``; with ``"volume"`` where the deformer
        follows none (``quality`` is ``"published"``). None without fibres.
    transport : FibreTransport or None
        The fibres in motion with the model ``"volume"``; None without fibres.
    metrics : FibreMetrics or None
        The fibres in motion with their measures; None without fibres.

    Raises
    ------
    TypeError, ValueError
        For a setting that no filter has, or that is not allowed; the message says what is.

    Examples
    --------
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> from vtkmuscle.pipelines import MusclePipeline
    >>> phantom = spindle_over_hinge()
    >>> muscle, attachments = phantom.muscles["spindle"], phantom.attachments["spindle"]
    >>> pipeline = MusclePipeline(
    ...     muscle, phantom.bones, phantom.motion, attachments, fixing={}, fibres={"n_fibres": 8}
    ... )
    >>> pipeline.metrics.update(time=phantom.motion.times[1]).output.GetNumberOfCells()
    8
    """

    def __init__(
        self,
        surface: Any,
        bones: Any,
        motion: RigidMotion,
        attachments: Any = None,
        *,
        superficial: Any = None,
        aponeuroses: Any = None,
        neighbours: Mapping[str, Any] | None = None,
        model: str = "volume",
        fixing: Mapping[str, Any] | None = None,
        fibres: Any = None,
        solver: Mapping[str, Any] | None = None,
    ) -> None:
        if model not in ("volume", "paths"):
            raise ValueError(f"MusclePipeline: model is {model!r}, but must be 'volume' or 'paths'")
        if model == "paths" and aponeuroses is not None:
            raise ValueError(
                "MusclePipeline: aponeuroses move with the muscle, which model='paths' does not deform; "
                "leave them out, or use model='volume'"
            )
        self.fixed = surface
        if fixing is not None:
            self.fixed = FixedPointDetector(muscle=surface, bones=bones, attachments=attachments, **fixing)
        weight_tolerance = WEIGHT_TOLERANCE
        self.paths = self.fibres = fibres
        if isinstance(fibres, Mapping):
            shaping = dict(fibres)
            weight_tolerance = shaping.pop("weight_tolerance", WEIGHT_TOLERANCE)
            self.paths = self.fibres = decompose(self.fixed, attachments, superficial, **shaping)
            if aponeuroses is not None:
                counts = {name: shaping[name] for name in ("n_fibres", "resolution") if name in shaping}
                self.fibres = decompose(self.fixed, attachments, aponeuroses=aponeuroses, **counts)
        self.moving = BoneMotion(bones=bones, motion=motion)
        self.deformer: PBDDeformer | None = None
        self.taut: TautFibres | None = None
        self.transport: FibreTransport | None = None
        self.metrics: FibreMetrics | None = None
        if model == "volume":
            self.deformer = PBDDeformer(
                muscle=self.fixed,
                rest_bones=bones,
                bones=self.moving,
                fibres=self.paths,
                neighbours=neighbours or None,
                **(solver or {}),
            )
        if self.fibres is None:
            return
        if self.deformer is None or self.deformer.quality == "published":
            self.taut = TautFibres(
                rest_fibres=self.paths,
                rest_muscle=self.fixed,
                bones=self.moving,
                attachments=attachments,
                **((solver or {}) if self.deformer is None else {}),
            )
        if self.deformer is not None:
            along_paths = self.fibres is self.paths  # the deformer's arrays of taut fibres are of the paths
            self.transport = FibreTransport(
                rest_fibres=self.fibres,
                rest_muscle=self.fixed,
                deformed_muscle=self.deformer,
                paths=self.taut,
                rest_paths=None if along_paths else self.paths,
                method="carried" if along_paths else "mean-value",
                weight_tolerance=weight_tolerance,
            )
        self.metrics = FibreMetrics(fibres=self.transport or self.taut, muscle=self.deformer, curvature=True)


def deform(
    muscle: Any,
    bones: Any,
    motion: RigidMotion,
    attachments: Any = None,
    *,
    fibres: Any = None,
    superficial: Any = None,
    fixing: Mapping[str, Any] | None = MappingProxyType({}),
    **solver: Any,
) -> PBDDeformer:
    """Return the chain that deforms a muscle with moving bones: FixedPointDetector, BoneMotion, PBDDeformer.

    Ask it for its output at a time of the motion: ``deform(...).update(time=30.0).output``.

    Parameters
    ----------
    muscle, bones, motion, attachments, superficial, fixing
        As of :class:`MusclePipeline`; by default ``fixing`` needs attachments.
    fibres : vtkPolyData or algorithm, optional
        Fibres at rest, for the paths.
    **solver
        Parameters of PBDDeformer.

    Returns
    -------
    PBDDeformer
        The end of the chain, which keeps all of it.

    Examples
    --------
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> from vtkmuscle.pipelines import deform
    >>> phantom = spindle_over_hinge()
    >>> muscle, attachments = phantom.muscles["spindle"], phantom.attachments["spindle"]
    >>> chain = deform(muscle, phantom.bones, phantom.motion, attachments, iterations=3)
    >>> deformed = chain.update(time=phantom.motion.times[1]).output
    >>> deformed.GetNumberOfPoints() == muscle.GetNumberOfPoints()
    True
    """
    given = {"superficial": superficial, "fixing": fixing, "fibres": fibres, "solver": solver}
    pipeline = MusclePipeline(muscle, bones, motion, attachments, **given)
    assert pipeline.deformer is not None
    return pipeline.deformer


def pull_taut(
    muscle: Any,
    bones: Any,
    motion: RigidMotion,
    fibres: Any,
    attachments: Any = None,
    *,
    fixing: Mapping[str, Any] | None = MappingProxyType({}),
    **settings: Any,
) -> TautFibres:
    """Return the chain that pulls fibres taut round moving bones: FixedPointDetector, BoneMotion, TautFibres.

    Ask it for its output at a time of the motion: ``pull_taut(...).update(time=30.0).output``.

    Parameters
    ----------
    muscle, bones, motion, attachments, fixing
        As of :func:`deform`.
    fibres : vtkPolyData or algorithm
        Fibres at rest, as of :func:`decompose`.
    **settings
        Parameters of TautFibres.

    Returns
    -------
    TautFibres
        The end of the chain, which keeps all of it.

    Examples
    --------
    >>> from vtkmuscle import phantoms
    >>> from vtkmuscle.pipelines import decompose, pull_taut
    >>> phantom = phantoms.spindle_over_hinge()
    >>> muscle, attachments = phantom.muscles["spindle"], phantom.attachments["spindle"]
    >>> fibres = decompose(muscle, attachments, n_fibres=8)
    >>> taut = pull_taut(muscle, phantom.bones, phantom.motion, fibres, attachments)
    >>> taut.update(time=phantom.motion.times[1]).output.GetNumberOfCells()
    8
    """
    pipeline = MusclePipeline(
        muscle, bones, motion, attachments, model="paths", fixing=fixing, fibres=fibres, solver=settings
    )
    assert pipeline.taut is not None
    return pipeline.taut
