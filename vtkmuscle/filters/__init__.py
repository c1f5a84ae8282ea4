"""VTK filters over :mod:`vtkmuscle.core`: one algorithm per file, imported when first used.

Examples
--------
>>> from vtkmuscle.filters import FibreSmoother, FibreTemplateSource
>>> fibres = FibreTemplateSource(kind="curved", n_fibres=10) >> FibreSmoother()
>>> fibres.update().output.GetNumberOfCells()
10
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vtkmuscle.data.attachments import AttachmentArea, attachments_from, attachments_of, via_rings_of
    from vtkmuscle.data.provenance import provenance_of
    from vtkmuscle.filters.attachment_estimator import AttachmentEstimator
    from vtkmuscle.filters.base.filter import Filter
    from vtkmuscle.filters.base.parameters import InputPort, OutputPort, Parameter
    from vtkmuscle.filters.bone_motion import BoneMotion
    from vtkmuscle.filters.fibre_metrics import FibreMetrics
    from vtkmuscle.filters.fibre_smoother import FibreSmoother
    from vtkmuscle.filters.fibre_template_source import FibreTemplateSource
    from vtkmuscle.filters.fibre_transport import FibreTransport
    from vtkmuscle.filters.fibre_trimmer import FibreTrimmer
    from vtkmuscle.filters.fibre_tubes import FibreTubes
    from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
    from vtkmuscle.filters.harmonic_field import HarmonicField
    from vtkmuscle.filters.linear_blend_fibres import LinearBlendFibres
    from vtkmuscle.filters.moment_arms import MomentArms
    from vtkmuscle.filters.pbd_deformer import PBDDeformer
    from vtkmuscle.filters.slice_morpher import SliceMorpher
    from vtkmuscle.filters.taut_fibres import TautFibres
    from vtkmuscle.filters.template_fitter import TemplateFitter

_SOURCES = {
    "AttachmentArea": "vtkmuscle.data.attachments",
    "AttachmentEstimator": "vtkmuscle.filters.attachment_estimator",
    "BoneMotion": "vtkmuscle.filters.bone_motion",
    "FibreMetrics": "vtkmuscle.filters.fibre_metrics",
    "FibreSmoother": "vtkmuscle.filters.fibre_smoother",
    "FibreTemplateSource": "vtkmuscle.filters.fibre_template_source",
    "FibreTransport": "vtkmuscle.filters.fibre_transport",
    "FibreTrimmer": "vtkmuscle.filters.fibre_trimmer",
    "FibreTubes": "vtkmuscle.filters.fibre_tubes",
    "Filter": "vtkmuscle.filters.base.filter",
    "FixedPointDetector": "vtkmuscle.filters.fixed_point_detector",
    "HarmonicField": "vtkmuscle.filters.harmonic_field",
    "InputPort": "vtkmuscle.filters.base.parameters",
    "LinearBlendFibres": "vtkmuscle.filters.linear_blend_fibres",
    "MomentArms": "vtkmuscle.filters.moment_arms",
    "OutputPort": "vtkmuscle.filters.base.parameters",
    "PBDDeformer": "vtkmuscle.filters.pbd_deformer",
    "Parameter": "vtkmuscle.filters.base.parameters",
    "SliceMorpher": "vtkmuscle.filters.slice_morpher",
    "TautFibres": "vtkmuscle.filters.taut_fibres",
    "TemplateFitter": "vtkmuscle.filters.template_fitter",
    "attachments_from": "vtkmuscle.data.attachments",
    "attachments_of": "vtkmuscle.data.attachments",
    "provenance_of": "vtkmuscle.data.provenance",
    "via_rings_of": "vtkmuscle.data.attachments",
}

__all__ = [
    "AttachmentArea",
    "AttachmentEstimator",
    "BoneMotion",
    "FibreMetrics",
    "FibreSmoother",
    "FibreTemplateSource",
    "FibreTransport",
    "FibreTrimmer",
    "FibreTubes",
    "Filter",
    "FixedPointDetector",
    "HarmonicField",
    "InputPort",
    "LinearBlendFibres",
    "MomentArms",
    "OutputPort",
    "PBDDeformer",
    "Parameter",
    "SliceMorpher",
    "TautFibres",
    "TemplateFitter",
    "attachments_from",
    "attachments_of",
    "provenance_of",
    "via_rings_of",
]


def __getattr__(name: str) -> Any:
    if name in _SOURCES:
        return getattr(import_module(_SOURCES[name]), name)
    raise AttributeError(f"module 'vtkmuscle.filters' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
