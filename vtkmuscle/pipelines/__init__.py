"""Ready-made chains of filters for a muscle.

:class:`MusclePipeline` has all stages of a muscle; ``decompose``, ``deform`` and ``pull_taut`` return the
last filter of a partial chain.
"""

from vtkmuscle.pipelines.fibres import FIBRE_SETTINGS, decompose
from vtkmuscle.pipelines.muscle import (
    DEFORMERS,
    QUALITIES,
    TRANSPORT_SETTINGS,
    WEIGHT_TOLERANCE,
    MusclePipeline,
    deform,
    pull_taut,
)

__all__ = [
    "DEFORMERS",
    "FIBRE_SETTINGS",
    "QUALITIES",
    "TRANSPORT_SETTINGS",
    "WEIGHT_TOLERANCE",
    "MusclePipeline",
    "decompose",
    "deform",
    "pull_taut",
]
