"""The chain of filters that fills a muscle with fibres, and its settings."""

from __future__ import annotations

from typing import Any

from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.fibre_smoother import FibreSmoother
from vtkmuscle.filters.fibre_template_source import FibreTemplateSource
from vtkmuscle.filters.fibre_trimmer import FibreTrimmer
from vtkmuscle.filters.slice_morpher import SliceMorpher
from vtkmuscle.filters.template_fitter import TemplateFitter
from vtkmuscle.pipelines.connecting import connected

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
    "slice_tolerance": (SliceMorpher, "slice_tolerance"),
    "continuity": (SliceMorpher, "continuity"),
    "twist": (SliceMorpher, "twist"),
    "largest_cut": (FibreTrimmer, "largest_cut"),
    "smoothing": (FibreSmoother, "iterations"),
    "smoothing_weight": (FibreSmoother, "k"),
    "filling": (FibreSmoother, "filling"),
}


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
    method, mapping, slice_tolerance, continuity, twist
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
    areas = {"muscle": muscle, "attachments": attachments}
    fitter = connected(
        TemplateFitter(axis=axis, angle_step=angle_step, refine=refine, cube=cube, mirror=mirror),
        template=source,
        superficial=superficial,
        **areas,
    )
    morpher = connected(
        SliceMorpher(
            method=method,
            mapping=mapping,
            slice_tolerance=slice_tolerance,
            continuity=continuity,
            twist=twist,
        ),
        template=fitter,
        superficial=superficial,
        **areas,
    )
    trimmer = connected(FibreTrimmer(largest_cut=largest_cut), fibres=morpher, **areas)
    smoother = FibreSmoother(iterations=smoothing, k=smoothing_weight, filling=filling)
    return connected(smoother, fibres=trimmer, **areas)
