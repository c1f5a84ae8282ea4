"""The usual chains of filters, ready made: fibres in a muscle, and a muscle that follows its bones."""

from __future__ import annotations

from typing import Any

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.filters.attachment_estimator import AttachmentEstimator
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

#: The settings of :func:`decompose`, and the parameter of a filter that each one is.
FIBRE_SETTINGS: dict[str, tuple[type[Filter], str]] = {
    "template": (FibreTemplateSource, "kind"),
    "template_file": (FibreTemplateSource, "file"),
    "n_fibres": (FibreTemplateSource, "n_fibres"),
    "resolution": (FibreTemplateSource, "resolution"),
    "axis": (TemplateFitter, "axis"),
    "angle_step": (TemplateFitter, "angle_step"),
    "refine": (TemplateFitter, "refine"),
    "cube": (TemplateFitter, "cube"),
    "mirror": (TemplateFitter, "mirror"),
    "method": (SliceMorpher, "method"),
    "mapping": (SliceMorpher, "mapping"),
    "spread": (SliceMorpher, "spread"),
    "slice_tolerance": (SliceMorpher, "slice_tolerance"),
    "continuity": (SliceMorpher, "continuity"),
    "twist": (SliceMorpher, "twist"),
    "largest_cut": (FibreTrimmer, "largest_cut"),
    "smoothing": (FibreSmoother, "iterations"),
    "smoothing_weight": (FibreSmoother, "k"),
    "filling": (FibreSmoother, "filling"),
}

#: Settings of fibres in a scene that are none of :func:`decompose`: how they are carried with the muscle.
TRANSPORT_SETTINGS: dict[str, tuple[type[Filter], str]] = {"prune": (FibreTransport, "prune")}
#: What ``prune`` is in scenes: of 1600 fibre points in 9878 vertices it keeps 5 MB of weights instead of
#: 126, and a frame takes 0.7 ms instead of 48; a muscle bent by a radian has fibre points 0.007 mm off,
#: 0.036 mm at most (``benchmarks/bench_fibres.py --transport``).
PRUNE = 0.3


def decompose(
    muscle: Any,
    attachments: Any,
    superficial: Any = None,
    *,
    template: str = "parallel",
    template_file: str | None = None,
    n_fibres: int = 100,
    resolution: int = 15,
    axis: str = "auto",
    angle_step: float = 5.0,
    refine: bool = False,
    cube: str = "upright",
    mirror: bool = False,
    method: str = "auto",
    mapping: str = "bijective",
    spread: str = "map",
    slice_tolerance: float | None = None,
    continuity: float = 0.2,
    twist: float = 0.0,
    largest_cut: float = 0.5,
    smoothing: int = 5,
    smoothing_weight: float = 4.0,
    filling: float | None = None,
) -> FibreSmoother:
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
    template, template_file, n_fibres, resolution
        Kind, file with a template of your own, number of fibres and segments per fibre of
        FibreTemplateSource.
    axis, angle_step, refine, cube, mirror
        Of TemplateFitter.
    method, mapping, spread, slice_tolerance, continuity, twist
        Of SliceMorpher.
    largest_cut
        Of FibreTrimmer.
    smoothing, smoothing_weight, filling
        Passes, weight ``k`` and ``filling`` of FibreSmoother, which keeps the fibres in the muscle and
        spreads parallel ones evenly through it.

    Returns
    -------
    FibreSmoother
        The end of the chain, which keeps all of it.

    Raises
    ------
    ValueError
        If a setting is not allowed; the message says what is.

    Examples
    --------
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> from vtkmuscle.pipelines import decompose
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> fibres = decompose(muscle, phantom.attachments[name], n_fibres=10).update().output
    >>> fibres.GetNumberOfCells()
    10
    """
    source = FibreTemplateSource(kind=template, file=template_file, n_fibres=n_fibres, resolution=resolution)
    fitter = _connected(
        TemplateFitter(axis=axis, angle_step=angle_step, refine=refine, cube=cube, mirror=mirror),
        source,
        muscle,
        attachments,
        superficial,
    )
    morpher = _connected(
        SliceMorpher(
            method=method,
            mapping=mapping,
            spread=spread,
            slice_tolerance=slice_tolerance,
            continuity=continuity,
            twist=twist,
        ),
        fitter,
        muscle,
        attachments,
        superficial,
    )
    trimmer = _connected(FibreTrimmer(largest_cut=largest_cut), morpher, muscle, attachments)
    smoother = FibreSmoother(iterations=smoothing, k=smoothing_weight, filling=filling)
    _connected(smoother, trimmer, muscle, attachments)
    return smoother


def deform(
    muscle: Any,
    bones: Any,
    motion: RigidMotion,
    attachments: Any = None,
    *,
    fibres: Any = None,
    superficial: Any = None,
    fixed: str | None = "attachment",
    fixed_tolerance: float | None = None,
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
        Where the muscle is attached; needed where ``fixed`` is ``"attachment"``.
    fibres : vtkPolyData or algorithm, optional
        Fibres at rest, for the anisotropy.
    superficial : vtkPolyData or algorithm, optional
        Fibres that are seen on the muscle's surface at rest, a few polylines, for the direction of the
        anisotropy.
    fixed : str or None, optional
        Method of FixedPointDetector; None for a muscle that has the point array ``FixedTo`` already.
    fixed_tolerance : float, optional
        Tolerance of FixedPointDetector.
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
    if fixed is not None:
        detector = FixedPointDetector(method=fixed, tolerance=fixed_tolerance)
        muscle = _connected(detector, muscle, bones, attachments)
    mover = _connected(BoneMotion(motion=motion), bones)
    deformer = PBDDeformer(**solver)
    for port, value in enumerate((muscle, mover, fibres, None, superficial, attachments)):
        deformer.connect(port, value)
    return deformer


def pull_taut(
    muscle: Any,
    bones: Any,
    motion: RigidMotion,
    fibres: Any,
    attachments: Any = None,
    *,
    fixed: str | None = "attachment",
    fixed_tolerance: float | None = None,
    **settings: Any,
) -> TautFibres:
    """Return the chain of filters that pulls fibres taut round moving bones, without deforming a muscle.

    The chain is FixedPointDetector and BoneMotion, then TautFibres; ask the last one for its output at a time
    of the motion: ``pull_taut(...).update(time=30.0).output``.

    Parameters
    ----------
    muscle, bones, motion, fixed, fixed_tolerance
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
    if fixed is not None:
        detector = FixedPointDetector(method=fixed, tolerance=fixed_tolerance)
        muscle = _connected(detector, muscle, bones, attachments)
    mover = _connected(BoneMotion(motion=motion), bones)
    taut = TautFibres(**settings)
    _connected(taut, fibres, muscle, mover, attachments)
    return taut


def estimate_attachments(
    muscle: Any, bones: Any, *, tolerance: float | None = None, origin: str | None = None
) -> Any:
    """Return attachments of a muscle for which there are no landmarks, from where it touches the bones.

    Parameters
    ----------
    muscle : vtkPolyData or algorithm
        Surface of triangles, in the rest pose.
    bones : vtkMultiBlockDataSet or algorithm
        Named blocks, in the rest pose.
    tolerance, origin
        Of AttachmentEstimator, which says how they are found and what they are good for.

    Returns
    -------
    vtkMultiBlockDataSet
        What :func:`decompose` and :func:`deform` take as attachments; each block has the field array
        ``Estimated``, which is 1.

    Raises
    ------
    ValueError
        If the muscle touches fewer than two bones.

    Examples
    --------
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> from vtkmuscle.pipelines import deform, estimate_attachments
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> attachments = estimate_attachments(muscle, phantom.bones)
    >>> chain = deform(muscle, phantom.bones, phantom.motion, attachments, iterations=3)
    >>> float(chain.update(time=0.0).output.GetFieldData().GetArray("VolumeRatio").GetValue(0))
    1.0
    """
    estimator = AttachmentEstimator(tolerance=tolerance, origin=origin)
    return _connected(estimator, muscle, bones).update().output


def _connected(algorithm: Filter, *inputs: Any) -> Filter:
    for port, value in enumerate(inputs):
        algorithm.connect(port, value)
    return algorithm
