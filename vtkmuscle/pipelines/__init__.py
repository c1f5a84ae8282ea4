"""Ready-made chains of filters for a muscle.

:class:`MusclePipeline` has all stages of a muscle; ``decompose`` and ``deform`` return the last filter of a
partial chain.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.words import suggestion
from vtkmuscle.data import toml_table
from vtkmuscle.filters.base import Filter, Parameter
from vtkmuscle.filters.bone_motion import BoneMotion
from vtkmuscle.filters.deformer import PRESETS
from vtkmuscle.filters.fibre_metrics import FibreMetrics
from vtkmuscle.filters.fibre_smoother import FibreSmoother
from vtkmuscle.filters.fibre_source import FibreSource
from vtkmuscle.filters.fibre_template_source import FibreTemplateSource
from vtkmuscle.filters.fibre_transport import FibreTransport, StiffTendons
from vtkmuscle.filters.fibre_trimmer import FibreTrimmer
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.filters.path_deformer import WEIGHT_TOLERANCE, PathDeformer
from vtkmuscle.filters.pbd_deformer import PBDDeformer
from vtkmuscle.filters.slice_morpher import SliceMorpher
from vtkmuscle.filters.taut_paths import PATH_PRESETS, TautPaths
from vtkmuscle.filters.template_fitter import TemplateFitter

_FILTERS: tuple[type[Filter], ...] = (
    FibreSource, FibreTemplateSource, TemplateFitter, SliceMorpher, FibreTrimmer, FibreSmoother,
)  # fmt: skip
#: Settings of :func:`decompose`: the parameters of all filters.
FIBRE_SETTINGS: dict[str, Parameter[Any]] = {
    name: declared for kind in _FILTERS for name, declared in kind.parameter_declarations.items()
}
#: Settings of published fibres, by publication.
PUBLISHED_FIBRES: Mapping[str, Mapping[str, Any]] = toml_table("vtkmuscle.pipelines", "published.toml")


def decompose(
    muscle: Any,
    attachments: Any,
    superficial: Any = None,
    *,
    aponeuroses: Any = None,
    published: str | None = None,
    **settings: Any,
) -> FibreSource | FibreSmoother:
    """Return the filters that fill a muscle with fibres.

    The result is a FibreSource, which chooses the course of fibres; or, with a setting of the template or of
    sections, the chain of FibreTemplateSource, TemplateFitter, SliceMorpher, FibreTrimmer and FibreSmoother.
    Filters compute on request.

    Parameters
    ----------
    muscle : vtkPolyData or algorithm
        Closed surface of triangles, in the rest pose.
    attachments : vtkMultiBlockDataSet or algorithm
        Attachment areas, at least one origin and one insertion; None is allowed with aponeuroses.
    superficial : vtkPolyData or algorithm, optional
        A few polylines seen on the muscle's surface: they orient the template.
    aponeuroses : vtkMultiBlockDataSet or algorithm, optional
        End surfaces of fibres in place of the attachment areas, see :mod:`vtkmuscle.data.attachments`.
    published : str, optional
        A name of :data:`PUBLISHED_FIBRES`: ``"kohout2012"`` or ``"kohout2014"``, fibres as in the papers,
        smoothed without the muscle. Further settings take precedence.
    **settings
        ``n_fibres``, ``resolution``, and ``course`` of FibreSource; or parameters of the other five filters:
        ``template``, ``smoothing_passes`` and so on.

    Raises
    ------
    TypeError
        For a keyword unknown to all filters.
    ValueError
        If a setting is not allowed, or does not go with another; the message says what does.

    Examples
    --------
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> from vtkmuscle.pipelines import decompose
    >>> phantom = spindle_over_hinge()
    >>> muscle, attachments = phantom.muscles["spindle"], phantom.attachments["spindle"]
    >>> fibres = decompose(muscle, attachments, n_fibres=10).output
    >>> fibres.GetNumberOfCells()
    10
    """
    if published is not None:
        if published not in PUBLISHED_FIBRES:
            hint = suggestion(published, PUBLISHED_FIBRES)
            raise ValueError(f"decompose has no published fibres {published!r}; {hint}")
        settings = {**PUBLISHED_FIBRES[published], **settings}
    for name in settings:
        if name not in FIBRE_SETTINGS:
            raise TypeError(f"decompose has no setting {name!r}; {suggestion(name, FIBRE_SETTINGS)}")
    of_sections = [name for name in settings if name not in FibreSource.parameter_declarations]
    where = {"muscle": muscle, "attachments": attachments}
    if not of_sections:
        return FibreSource(superficial=superficial, aponeuroses=aponeuroses, **where, **settings)
    course = settings.pop("course", "sections")
    if aponeuroses is not None or course != "sections":
        why = f"course is {course!r}" if aponeuroses is None else "fibres between aponeuroses are straight"
        problem = f"decompose: {of_sections[0]} is a setting of fibres through sections, but {why}"
        raise ValueError(f"{problem}; leave out {', '.join(of_sections)}")

    def own(kind: type[Filter]) -> dict[str, Any]:
        return {name: value for name, value in settings.items() if name in kind.parameter_declarations}

    source = FibreTemplateSource(**own(FibreTemplateSource))
    fitted = TemplateFitter(template=source, superficial=superficial, **where, **own(TemplateFitter))
    morphed = SliceMorpher(template=fitted, superficial=superficial, **where, **own(SliceMorpher))
    trimmed = FibreTrimmer(fibres=morphed, **where, **own(FibreTrimmer))
    # Without the muscle the smoother takes three-point means, as printed.
    return FibreSmoother(fibres=trimmed, **({} if published else where), **own(FibreSmoother))


#: Settings of fibres for the transport with the muscle.
TRANSPORT_SETTINGS: dict[str, Parameter[Any]] = dict(FibreTransport.parameter_declarations)
#: Deformers: taut paths with skinning, position based dynamics, no deformation.
DEFORMERS: Mapping[str, type[PathDeformer] | type[PBDDeformer] | None] = MappingProxyType(
    {"paths": PathDeformer, "pbd": PBDDeformer, "none": None}
)
#: Settings of each deformer.
DEFORMER_SETTINGS = {name: getattr(kind, "parameter_declarations", {}) for name, kind in DEFORMERS.items()}
#: Settings of paths that only check the lengths of fibres.
FEW_PATHS: Mapping[str, Any] = {"quality": "preview", "n_paths": 9, "levers": False, "bows": False}
#: Presets of TautPaths and PathDeformer, and further presets of PBDDeformer.
QUALITIES = tuple(dict.fromkeys([*PATH_PRESETS, *PRESETS]))


class MusclePipeline:
    """The filters of a muscle, from surface to fibre measures.

    Stages compute on request: ``pipeline.deformer.update(time=30.0).output`` is the muscle,
    ``pipeline.metrics.update(time=30.0).output`` the fibres with their measures.

    Parameters
    ----------
    surface, bones : vtkPolyData, vtkMultiBlockDataSet, or algorithms
        Closed surface of triangles, and named blocks, in the rest pose.
    motion : RigidMotion
        Motion of the bones.
    attachments : vtkMultiBlockDataSet or algorithm, optional
        Attachment areas and via rings.
    superficial : vtkPolyData or algorithm, optional
        A few fibres seen on the surface at rest, to orient the template.
    neighbours : mapping of str to algorithm, optional
        Deformers of other muscles, as obstacles.
    deformer : str, optional
        ``"paths"``, skinning to taut paths (PathDeformer); ``"pbd"``, position based dynamics of the surface
        (PBDDeformer), without paths; ``"none"``, the paths alone.
    quality : str, optional
        Preset of TautPaths and the deformer.
    fixing : mapping or None, optional
        Parameters of FixedPointDetector; None for a surface with the point array ``FixedTo``.
    aponeuroses : vtkMultiBlockDataSet or algorithm, optional
        End surfaces of fibres, on the muscle or within the muscle: fibres between aponeuroses move with the
        muscle. Paths still run between bones.
    fibres : mapping, vtkPolyData, algorithm or None, optional
        Keyword arguments of :func:`decompose` and parameters of FibreTransport (``weight_tolerance``, by
        default :data:`WEIGHT_TOLERANCE`); or fibres at rest; or None for a muscle without fibres.
    paths : mapping, optional
        Parameters of TautPaths. With ``deformer="pbd"`` paths are computed only with this argument.
    solver : mapping, optional
        Parameters of the deformer.

    Attributes
    ----------
    fixed : FixedPointDetector, vtkPolyData or algorithm
        The muscle at rest with the point array ``FixedTo``: the surface itself if ``fixing`` is None.
    rest_paths, fibres : vtkPolyData, algorithm or None
        Lines between bones, and fibres, at rest: between the aponeuroses if present, else the paths.
    moving : BoneMotion
        The bones in motion.
    taut_paths, deformer : TautPaths, PathDeformer, PBDDeformer or None
        The paths in motion, None for ``deformer="pbd"`` without ``paths``; and the muscle in motion, None for
        ``deformer="none"``.
    few_paths : TautPaths
        Few paths, which carry those of all fibres, to check lengths without ``taut_paths``: on four muscles
        of a hip mean lengths of 9 paths are within 0.6 % of those of 100.
    metrics : FibreMetrics or None
        The fibres in motion with their measures; None without fibres. With ``deformer="none"`` the paths.

    Raises
    ------
    TypeError, ValueError
        For an unknown setting, or a value that is not allowed; the message lists the allowed values.

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
        self, surface: Any, bones: Any, motion: RigidMotion, attachments: Any = None, *,
        superficial: Any = None, aponeuroses: Any = None, neighbours: Mapping[str, Any] | None = None,
        deformer: str = "paths", quality: str | None = None, fixing: Mapping[str, Any] | None = None,
        fibres: Any = None, paths: Mapping[str, Any] | None = None, solver: Mapping[str, Any] | None = None,
    ) -> None:  # fmt: skip
        if deformer not in DEFORMERS:
            allowed = ", ".join(map(repr, DEFORMERS))
            raise ValueError(f"MusclePipeline: deformer is {deformer!r}, but must be one of {allowed}")
        if deformer == "none" and aponeuroses is not None:
            problem = "fibres between aponeuroses need a deformed muscle, but deformer is 'none'"
            remedy = "leave aponeuroses out, or choose another deformer"
            raise ValueError(f"MusclePipeline: {problem}; {remedy}")
        self.fixed = surface
        if fixing is not None:
            self.fixed = FixedPointDetector(muscle=surface, bones=bones, attachments=attachments, **fixing)
        weight_tolerance = WEIGHT_TOLERANCE
        self.rest_paths = self.fibres = fibres
        if isinstance(fibres, Mapping):
            shaping = dict(fibres)
            weight_tolerance = shaping.pop("weight_tolerance", WEIGHT_TOLERANCE)
            self.rest_paths = self.fibres = decompose(self.fixed, attachments, superficial, **shaping)
            if aponeuroses is not None:
                counts = {name: shaping[name] for name in ("n_fibres", "resolution") if name in shaping}
                self.fibres = decompose(self.fixed, attachments, aponeuroses=aponeuroses, **counts)
        self.moving = BoneMotion(bones=bones, motion=motion)
        preset = {} if quality is None else {"quality": quality}
        posed = {"rest_bones": bones, "bones": self.moving}
        self.taut_paths: TautPaths | None = None
        at_rest = {"rest_fibres": self.rest_paths, "rest_muscle": self.fixed, "attachments": attachments}
        self.few_paths = TautPaths(**at_rest, **posed, **FEW_PATHS)
        if deformer != "pbd" or (paths is not None and self.rest_paths is not None):
            own = {**(preset if deformer != "pbd" or quality in PATH_PRESETS else {}), **(paths or {})}
            self.taut_paths = TautPaths(**at_rest, **posed, **own)
        inputs = {"muscle": self.fixed, "fibres": self.rest_paths, "neighbours": neighbours or None, **posed}
        settings = {**inputs, **preset, **(solver or {})}
        self.deformer: PathDeformer | PBDDeformer | None = None
        if deformer == "paths":
            self.deformer = PathDeformer(paths=self.taut_paths, **settings)
        elif deformer == "pbd":
            self.deformer = PBDDeformer(**settings)
        self.metrics: FibreMetrics | None = None
        if self.fibres is not None:
            moved = self._moving_fibres(weight_tolerance)
            self.metrics = FibreMetrics(fibres=moved, muscle=self.deformer, paths=self.taut_paths)

    def _moving_fibres(self, weight_tolerance: float) -> Any:
        """Return the source of the fibres in motion."""
        if self.deformer is None:
            return self.taut_paths
        if isinstance(self.deformer, PathDeformer) and self.fibres is self.rest_paths:
            return self.deformer.GetOutputPort(1)
        muscle = {"rest_muscle": self.fixed, "deformed_muscle": self.deformer}
        moved = FibreTransport(rest_fibres=self.fibres, weight_tolerance=weight_tolerance, **muscle)
        if self.fibres is self.rest_paths or self.taut_paths is None:
            return moved
        return StiffTendons(fibres=moved, rest_fibres=self.fibres, paths=self.taut_paths, **muscle)


def deform(
    muscle: Any, bones: Any, motion: RigidMotion, attachments: Any = None, *, deformer: str = "paths",
    fibres: Any = None, superficial: Any = None, fixing: Mapping[str, Any] | None = MappingProxyType({}),
    **solver: Any,
) -> PathDeformer | PBDDeformer:  # fmt: skip
    """Return the chain that deforms a muscle with moving bones.

    Request the output at a time of the motion: ``deform(...).update(time=30.0).output``.

    Parameters
    ----------
    muscle, bones, motion, attachments, superficial, fixing
        As of :class:`MusclePipeline`; by default ``fixing`` needs attachments.
    deformer : str, optional
        ``"paths"`` or ``"pbd"``.
    fibres : vtkPolyData or algorithm, optional
        Fibres at rest, for the paths, or for the directions of soft edges.
    **solver
        Parameters of the deformer.

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
    settings = {"superficial": superficial, "fixing": fixing, "fibres": fibres, "solver": solver}
    pipeline = MusclePipeline(muscle, bones, motion, attachments, deformer=deformer, **settings)
    if pipeline.deformer is None:
        raise ValueError("deform: deformer is 'none', but must be 'paths' or 'pbd'")
    return pipeline.deformer
