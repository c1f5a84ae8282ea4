"""What a run asks of a study of its errors."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Protocol

from vtkmuscle.core.accuracy.estimate import Estimate
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.run.track import MuscleTrack


class ErrorStudy(Protocol):
    """Further solves beside the run's own, and estimates; :class:`vtkmuscle.accuracy.ErrorStudy` is one."""

    def jobs(self, numbers: range, stop: threading.Event) -> Mapping[str, Callable[[], None]]:
        """Return what is to be done beside the muscles, by its names."""
        ...

    def estimates(self, name: str, track: MuscleTrack, motion: RigidMotion) -> Mapping[str, Estimate]:
        """Return a muscle's quantities with their errors, and put them into its report."""
        ...
