"""Filters that fill a muscle with fibres, and their settings."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from vtkmuscle.core.words import suggestion
from vtkmuscle.filters.base import Filter, Parameter
from vtkmuscle.filters.fibre_smoother import FibreSmoother
from vtkmuscle.filters.fibre_source import FibreSource
from vtkmuscle.filters.fibre_template_source import FibreTemplateSource
from vtkmuscle.filters.fibre_trimmer import FibreTrimmer
from vtkmuscle.filters.slice_morpher import SliceMorpher
from vtkmuscle.filters.template_fitter import TemplateFitter

_FILTERS: tuple[type[Filter], ...] = (
    FibreSource, FibreTemplateSource, TemplateFitter, SliceMorpher, FibreTrimmer, FibreSmoother,
)  # fmt: skip
#: Settings of :func:`decompose`: the parameters of all filters.
FIBRE_SETTINGS: dict[str, Parameter[Any]] = {
    name: declared for kind in _FILTERS for name, declared in kind.parameter_declarations.items()
}
#: Settings of published fibres: planes, maps, ends and smoothing of Kohout et al. 2012 as printed, with
#: the axis between the centroids; and slices along isolines of a harmonic function (Kohout and Kukacka 2014),
#: also used by Kohout and Cervenka 2021. Both leave parts of the muscle empty.
PUBLISHED_FIBRES: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "kohout2012": {
            "axis": "attachments",
            "angle_step": 5.0,
            "method": "plane",
            "continuity": 0.0,
            "end_rule": "closest",
            "smoothing_weight": 4.0,
            "spreading": 0.0,
        },
        "kohout2014": {"method": "harmonic", "spreading": 0.0},
    }
)


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

    Returns
    -------
    FibreSource or FibreSmoother
        The last filter of the chain.

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
        raise ValueError(
            f"decompose: {of_sections[0]} is a setting of fibres through sections, but {why}; "
            f"leave out {', '.join(of_sections)}"
        )

    def own(kind: type[Filter]) -> dict[str, Any]:
        return {name: value for name, value in settings.items() if name in kind.parameter_declarations}

    source = FibreTemplateSource(**own(FibreTemplateSource))
    fitted = TemplateFitter(template=source, superficial=superficial, **where, **own(TemplateFitter))
    morphed = SliceMorpher(template=fitted, superficial=superficial, **where, **own(SliceMorpher))
    trimmed = FibreTrimmer(fibres=morphed, **where, **own(FibreTrimmer))
    # Without the muscle the smoother takes three-point means, as printed.
    return FibreSmoother(fibres=trimmed, **({} if published else where), **own(FibreSmoother))
