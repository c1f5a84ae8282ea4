"""What a run asks of a study of its errors, and the errors in its folder."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.accuracy.estimate import Estimate
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.io.parts import Part, Parts
from vtkmuscle.run.finished import FINISHED
from vtkmuscle.run.track import MuscleTrack

#: Where errors are, in the folder of what is finished.
ERRORS = "errors"


class ErrorStudy(Protocol):
    """Further solves beside the run's own, and estimates; :class:`vtkmuscle.accuracy.ErrorStudy` is one."""

    def jobs(
        self, numbers: range, bones: Mapping[str, vtkPolyData], stop: threading.Event
    ) -> Mapping[str, Callable[[], None]]:
        """Return what is to be done beside the muscles, by its names."""
        ...

    def estimates(self, name: str, track: MuscleTrack, motion: RigidMotion) -> Mapping[str, Estimate]:
        """Return a muscle's quantities with their errors, and put them into its report."""
        ...


def note_errors(folder: Path, name: str, errors: Mapping[str, Estimate]) -> None:
    """Keep a muscle's quantities with their errors in a run's folder."""
    facts, arrays = {}, {}
    for i, (quantity, one) in enumerate(errors.items()):
        facts[quantity] = {"unit": one.unit, "causes": list(one.parts)}
        arrays[f"value{i}"] = np.asarray(one.value)
        arrays |= {f"part{i}_{j}": np.asarray(part) for j, part in enumerate(one.parts.values())}
    Parts(folder / FINISHED / ERRORS).write(name, "", Part(facts, arrays))


def read_errors(folder: Path, name: str) -> dict[str, Estimate]:
    """Return what :func:`note_errors` has kept; nothing where that is not there, or damaged."""
    kept = Parts(folder / FINISHED / ERRORS).read(name)
    if kept is None:
        return {}
    return {
        quantity: Estimate(
            kept.arrays[f"value{i}"],
            fact["unit"],
            {cause: kept.arrays[f"part{i}_{j}"] for j, cause in enumerate(fact["causes"])},
        )
        for i, (quantity, fact) in enumerate(kept.facts.items())
    }
