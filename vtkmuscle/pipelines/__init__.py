"""The usual chains of filters, ready made: fibres in a muscle, and a muscle that follows its bones.

:class:`MusclePipeline` holds all stages of one muscle; ``decompose``, ``deform`` and ``pull_taut`` return the
last filter of a part of them.
"""

from vtkmuscle.pipelines.attachments import estimate_attachments
from vtkmuscle.pipelines.fibres import FIBRE_SETTINGS, decompose
from vtkmuscle.pipelines.muscle import PRUNE, TRANSPORT_SETTINGS, MusclePipeline, deform, pull_taut

__all__ = [
    "FIBRE_SETTINGS",
    "PRUNE",
    "TRANSPORT_SETTINGS",
    "MusclePipeline",
    "decompose",
    "deform",
    "estimate_attachments",
    "pull_taut",
]
