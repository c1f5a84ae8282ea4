"""The chain of filters that fills a muscle with fibres, and its settings."""

from __future__ import annotations

from typing import Any

from vtkmuscle.core.words import suggestion
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.fibre_smoother import FibreSmoother
from vtkmuscle.filters.fibre_template_source import FibreTemplateSource
from vtkmuscle.filters.fibre_trimmer import FibreTrimmer
from vtkmuscle.filters.slice_morpher import SliceMorpher
from vtkmuscle.filters.template_fitter import TemplateFitter

#: The filters of :func:`decompose`, in order.
FIBRE_CHAIN: tuple[type[Filter], ...] = (
    FibreTemplateSource, TemplateFitter, SliceMorpher, FibreTrimmer, FibreSmoother,
)  # fmt: skip
#: The settings of :func:`decompose`, and the parameter of a filter that each one is, by the same name.
FIBRE_SETTINGS: dict[str, tuple[type[Filter], str]] = {
    name: (kind, name) for kind in FIBRE_CHAIN for name in kind.parameter_declarations
}


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
    >>> muscle, attachments = phantom.muscles["spindle"], phantom.attachments["spindle"]
    >>> fibres = decompose(muscle, attachments, n_fibres=10).output
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
