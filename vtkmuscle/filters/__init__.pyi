from .attachment_estimator import AttachmentEstimator as AttachmentEstimator
from .base import (
    AttachmentArea as AttachmentArea,
    Filter as Filter,
    InputPort as InputPort,
    OutputPort as OutputPort,
    Parameter as Parameter,
    attachments_from as attachments_from,
    attachments_of as attachments_of,
    provenance_of as provenance_of,
    via_rings_of as via_rings_of,
)
from .bone_motion import BoneMotion as BoneMotion
from .fibre_metrics import FibreMetrics as FibreMetrics
from .fibre_smoother import FibreSmoother as FibreSmoother
from .fibre_source import FibreSource as FibreSource
from .fibre_template_source import FibreTemplateSource as FibreTemplateSource
from .fibre_transport import FibreTransport as FibreTransport, StiffTendons as StiffTendons
from .fibre_trimmer import FibreTrimmer as FibreTrimmer
from .fibre_tubes import FibreTubes as FibreTubes
from .fixed_point_detector import FixedPointDetector as FixedPointDetector
from .label_surfaces import LabelSurfaces as LabelSurfaces
from .linear_blend_fibres import LinearBlendFibres as LinearBlendFibres
from .moment_arms import MomentArms as MomentArms
from .path_deformer import PathDeformer as PathDeformer
from .pbd_deformer import PBDDeformer as PBDDeformer
from .slice_morpher import SliceMorpher as SliceMorpher
from .taut_paths import TautPaths as TautPaths
from .template_fitter import TemplateFitter as TemplateFitter

def filter_classes() -> list[type[Filter]]:
    """Return all filters, sorted by name."""
