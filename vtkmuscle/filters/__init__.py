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
    from vtkmuscle.filters.attachment_estimator import AttachmentEstimator
    from vtkmuscle.filters.attachments import AttachmentArea, attachments_from, attachments_of, via_rings_of
    from vtkmuscle.filters.base import Filter
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
    from vtkmuscle.filters.parameters import InputPort, OutputPort, Parameter
    from vtkmuscle.filters.pbd_deformer import PBDDeformer
    from vtkmuscle.filters.provenance import provenance_of
    from vtkmuscle.filters.slice_morpher import SliceMorpher
    from vtkmuscle.filters.template_fitter import TemplateFitter

_SOURCES = {
    "AttachmentArea": "attachments",
    "AttachmentEstimator": "attachment_estimator",
    "BoneMotion": "bone_motion",
    "FibreMetrics": "fibre_metrics",
    "FibreSmoother": "fibre_smoother",
    "FibreTemplateSource": "fibre_template_source",
    "FibreTransport": "fibre_transport",
    "FibreTrimmer": "fibre_trimmer",
    "FibreTubes": "fibre_tubes",
    "Filter": "base",
    "FixedPointDetector": "fixed_point_detector",
    "HarmonicField": "harmonic_field",
    "InputPort": "parameters",
    "LinearBlendFibres": "linear_blend_fibres",
    "MomentArms": "moment_arms",
    "OutputPort": "parameters",
    "PBDDeformer": "pbd_deformer",
    "Parameter": "parameters",
    "SliceMorpher": "slice_morpher",
    "TemplateFitter": "template_fitter",
    "attachments_from": "attachments",
    "attachments_of": "attachments",
    "provenance_of": "provenance",
    "via_rings_of": "attachments",
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
    "TemplateFitter",
    "attachments_from",
    "attachments_of",
    "provenance_of",
    "via_rings_of",
]


def __getattr__(name: str) -> Any:
    if name in _SOURCES:
        return getattr(import_module(f"vtkmuscle.filters.{_SOURCES[name]}"), name)
    raise AttributeError(f"module 'vtkmuscle.filters' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
