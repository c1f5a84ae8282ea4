"""The usual chains of filters, ready made: fibres in a muscle, and a muscle that follows its bones."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.words import suggestion
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.bone_motion import BoneMotion
from vtkmuscle.filters.fibre_smoother import FibreSmoother
from vtkmuscle.filters.fibre_template_source import FibreTemplateSource
from vtkmuscle.filters.fibre_transport import FibreTransport
from vtkmuscle.filters.fibre_trimmer import FibreTrimmer
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.filters.pbd_deformer import PBDDeformer
from vtkmuscle.filters.slice_morpher import SliceMorpher
from vtkmuscle.filters.taut_fibres import TautFibres
from vtkmuscle.filters.template_fitter import TemplateFitter

#: The filters of :func:`decompose`, in order.
FIBRE_CHAIN: tuple[type[Filter], ...] = (
    FibreTemplateSource, TemplateFitter, SliceMorpher, FibreTrimmer, FibreSmoother,
)  # fmt: skip
#: The settings of :func:`decompose`, and the parameter of a filter that each one is, by the same name.
FIBRE_SETTINGS: dict[str, tuple[type[Filter], str]] = {
    name: (kind, name) for kind in FIBRE_CHAIN for name in kind.parameter_declarations
}
#: Settings of fibres in a scene that are none of :func:`decompose`: how they are carried with the muscle.
TRANSPORT_SETTINGS: dict[str, tuple[type[Filter], str]] = {
    "weight_tolerance": (FibreTransport, "weight_tolerance")
}
#: What ``weight_tolerance`` is in scenes: of 1600 fibre points in 9878 vertices it keeps 5 MB of weights
#: instead of 126, and a frame takes 0.7 ms instead of 48; a muscle bent by a radian has fibre points
#: 0.007 mm off, 0.036 mm at most (``benchmarks/bench_fibres.py --transport``).
WEIGHT_TOLERANCE = 0.3


def decompose(muscle: Any, attachments: Any, superficial: Any = None, **settings: Any) -> FibreSmoother:
    """Return the chain of filters that fills a muscle with fibres.

    The chain is FibreTemplateSource, TemplateFitter, SliceMorpher, FibreTrimmer and FibreSmoother; nothing
    is computed before the last one is asked for its output.

    Parameters
    ----------
    muscle : vtkPolyData or algorithm
        Closed surface of triangles, in the rest pose.
    attachments : vtkMultiBlockDataSet or algorithm
        Where it is attached, at least one origin and one insertion.
    superficial : vtkPolyData or algorithm, optional
        Fibres that are seen on the muscle's surface, a few polylines: the template is turned and twisted such
        that its fibres follow them.
    **settings
        Parameters of the five filters: ``template``, ``n_fibres``, ``smoothing_passes`` and so on.

    Returns
    -------
    FibreSmoother
        The end of the chain, which keeps all of it.

    Raises
    ------
    TypeError
        For a keyword that is a parameter of none of the filters.
    ValueError
        If a setting is not allowed; the message says what is.

    Examples
    --------
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> from vtkmuscle.pipelines import decompose
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> fibres = decompose(muscle, phantom.attachments[name], n_fibres=10).output
    >>> fibres.GetNumberOfCells()
    10
    """
    for name in settings:
        if name not in FIBRE_SETTINGS:
            raise TypeError(f"decompose has no setting {name!r}; {suggestion(name, FIBRE_SETTINGS)}")

    def own(kind: type[Filter]) -> dict[str, Any]:
        return {name: value for name, value in settings.items() if name in kind.parameter_declarations}

    where = {"muscle": muscle, "attachments": attachments}
    source = FibreTemplateSource(**own(FibreTemplateSource))
    fitted = TemplateFitter(template=source, superficial=superficial, **where, **own(TemplateFitter))
    morphed = SliceMorpher(template=fitted, superficial=superficial, **where, **own(SliceMorpher))
    trimmed = FibreTrimmer(fibres=morphed, **where, **own(FibreTrimmer))
    return FibreSmoother(fibres=trimmed, **where, **own(FibreSmoother))


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
    """Return the chain of filters that deforms a muscle with moving bones.

    The chain is FixedPointDetector and BoneMotion, then PBDDeformer; ask the last one for its output at
    a time of the motion: ``deform(...).update(time=30.0).output``.

    Parameters
    ----------
    muscle : vtkPolyData or algorithm
        Closed surface of triangles, in the rest pose.
    bones : vtkMultiBlockDataSet or algorithm
        Named blocks, in the rest pose.
    motion : RigidMotion
        How the bones move.
    attachments : vtkMultiBlockDataSet or algorithm, optional
        Where the muscle is attached; needed by the method ``"attachment"`` of
        FixedPointDetector.
    fibres : vtkPolyData or algorithm, optional
        Fibres at rest, for the anisotropy.
    superficial : vtkPolyData or algorithm, optional
        Fibres that are seen on the muscle's surface at rest, a few polylines, for the direction of the
        anisotropy.
    fixing : mapping or None, optional
        Parameters of FixedPointDetector, as ``{"method": "proximity", "distance": 3.0}``; None for a muscle
        that has the point array ``FixedTo`` already.
    **solver
        Parameters of PBDDeformer.

    Returns
    -------
    PBDDeformer
        The end of the chain, which keeps all of it.

    Raises
    ------
    TypeError
        For a keyword that is no parameter of PBDDeformer.
    ValueError
        If a setting is not allowed; the message says what is.

    Examples
    --------
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> from vtkmuscle.pipelines import deform
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> chain = deform(muscle, phantom.bones, phantom.motion, phantom.attachments[name], iterations=3)
    >>> deformed = chain.update(time=phantom.motion.times[1]).output
    >>> deformed.GetNumberOfPoints() == muscle.GetNumberOfPoints()
    True
    """
    return PBDDeformer(
        muscle=_fixed(muscle, bones, attachments, fixing),
        bones=BoneMotion(bones=bones, motion=motion),
        fibres=fibres,
        superficial=superficial,
        attachments=attachments,
        **solver,
    )


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
    """Return the chain of filters that pulls fibres taut round moving bones, without deforming a muscle.

    The chain is FixedPointDetector and BoneMotion, then TautFibres; ask the last one for its output at a time
    of the motion: ``pull_taut(...).update(time=30.0).output``.

    Parameters
    ----------
    muscle, bones, motion, fixing
        As of :func:`deform`.
    fibres : vtkPolyData or algorithm
        Fibres at rest, as of :func:`decompose`.
    attachments : vtkMultiBlockDataSet or algorithm, optional
        Where the muscle is attached, and via rings.
    **settings
        Parameters of TautFibres.

    Returns
    -------
    TautFibres
        The end of the chain, which keeps all of it.

    Raises
    ------
    TypeError
        For a keyword that is no parameter of TautFibres.
    ValueError
        If a setting is not allowed; the message says what is.

    Examples
    --------
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> from vtkmuscle.pipelines import decompose, pull_taut
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> attachments = phantom.attachments[name]
    >>> fibres = decompose(muscle, attachments, n_fibres=8)
    >>> taut = pull_taut(muscle, phantom.bones, phantom.motion, fibres, attachments)
    >>> taut.update(time=phantom.motion.times[1]).output.GetNumberOfCells()
    8
    """
    return TautFibres(
        rest_fibres=fibres,
        rest_muscle=_fixed(muscle, bones, attachments, fixing),
        bones=BoneMotion(bones=bones, motion=motion),
        attachments=attachments,
        **settings,
    )


def _fixed(muscle: Any, bones: Any, attachments: Any, fixing: Mapping[str, Any] | None) -> Any:
    """Return the muscle with its fixed points marked, by the settings of FixedPointDetector."""
    if fixing is None:
        return muscle
    return FixedPointDetector(muscle=muscle, bones=bones, attachments=attachments, **fixing)
