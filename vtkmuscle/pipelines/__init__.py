"""The usual chains of filters, ready made: fibres in a muscle, and a muscle that follows its bones.

:class:`MusclePipeline` holds all stages of one muscle; ``decompose``, ``deform`` and ``pull_taut`` return the
last filter of a part of them.
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
