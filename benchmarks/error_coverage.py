"""How often the errors that a run states cover the true ones, on phantoms with known answers.

    python benchmarks/error_coverage.py
    python benchmarks/error_coverage.py --rst docs/explanation/errors_tables

Every phantom of how_right.py is run with ``errors=True``, with default fibres; its mean moment arm, and the
mean length where that is known, are compared with the known ones pose by pose, and so are length at rest and
physiological cross-sectional area of the blocks of known fibres. A pose is covered where the mean is off by
no more than is stated.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from how_right import N_FIBRES, Known, Table, known_phantoms
from numpy.typing import NDArray

from vtkmuscle import Scene, phantoms, run_with_errors
from vtkmuscle.core.estimate import Estimate, root_of_squares
from vtkmuscle.core.template.kinds import KINDS

Floats = NDArray[np.float64]

#: Causes that every run states, without further solves.
ALWAYS = ("solve", "segments", "fibres", "slopes", "facets")
#: What arithmetic leaves of an exact answer [mm, mm^2].
ROUNDING = 1e-6
#: Phantoms whose known length is not from attachment to attachment, but to the edge of one.
ELSEWHERE = ("wrapping_cylinder",)


@dataclass(frozen=True, eq=False)
class Compared:
    """A quantity of a phantom at some poses: what is stated, and what is known."""

    phantom: str
    quantity: str
    stated: Estimate
    known: Floats

    @property
    def off(self) -> Floats:
        """How far the value is off at each pose."""
        return np.asarray(np.abs(self.stated.value - self.known))

    def covered(self, causes: Sequence[str] | None = None) -> NDArray[np.bool_]:
        """Return at which poses the stated error covers the true one, by some causes or by all."""
        parts = self.stated.parts
        chosen = [part for cause, part in parts.items() if causes is None or cause in causes]
        total = np.broadcast_to(root_of_squares(*chosen), self.off.shape)
        return np.asarray(self.off <= total + ROUNDING)


def compared(case: Known, *, every: int = 1, **asked: Any) -> Iterator[Compared]:
    """Run a phantom along its way, and yield its quantities; ``asked`` is of ``run_with_errors``."""
    chosen = slice(None, None, every)
    places, answers = case.places[chosen], case.answers[chosen]
    way = case.motion.part(np.arange(len(case.places))[chosen])
    motion = replace(way, times=np.arange(float(len(places))))
    whole = Scene.from_phantom(case.phantom, n_fibres=N_FIBRES)
    result = run_with_errors(replace(whole, motion=motion), figures=False, **({"errors": ()} | asked))
    ((_, errors),) = result.errors.items()
    if case.quantity == "length":
        yield Compared(case.name, "length", errors["length"], answers)
        return
    yield Compared(case.name, "moment arm", errors["moment_arm_way"], answers)
    length: Any = case.phantom.known.get("length")
    if "coordinates" not in case.phantom.known and case.phantom.name not in ELSEWHERE:
        lengths = np.array([length(float(place)) for place in places])
        yield Compared(case.name, "length", errors["length"], lengths)


def compared_block(kind: str, **asked: Any) -> Iterator[Compared]:
    """Yield the fibre length at rest and the area of a block of known fibres."""
    phantom = phantoms.fibre_block(kind)
    scene = Scene.from_phantom(phantom, n_fibres=N_FIBRES)
    result = run_with_errors(scene, figures=False, frames="0:1", **({"errors": ()} | asked))
    length: Any = phantom.known["fibre_length"]
    if callable(length):
        places = (np.arange(20) + 0.5) / 20.0
        length = np.mean([length(r, s) for r in places for s in places])
    ((_, errors),) = result.errors.items()
    name, volume = f"{kind} block", float(np.asarray(phantom.known["volume"]))
    yield Compared(name, "fibre length", errors["fibre_length"], np.array([length]))
    yield Compared(name, "area", errors["pcsa"], np.array([volume / length]))


def all_compared(**asked: Any) -> Iterator[Compared]:
    """Yield all quantities of all phantoms."""
    for case in known_phantoms():
        yield from _told(case.name, compared(case, **asked))
    for kind in KINDS:
        yield from _told(f"{kind} block", compared_block(kind, **asked))


def _told(name: str, found: Iterator[Compared]) -> Iterator[Compared]:
    before = time.process_time()
    yield from found
    print(f"{name}: {time.process_time() - before:.0f} s of processor", file=sys.stderr, flush=True)


def share(found: Sequence[Compared], causes: Sequence[str] | None = None) -> tuple[int, int]:
    """Return how many poses are covered, and of how many."""
    covered = [one.covered(causes) for one in found]
    return int(sum(each.sum() for each in covered)), sum(map(len, covered))


def coverage_table(found: Sequence[Compared]) -> Table:
    """Return a row per phantom and quantity, and one for all."""
    header = (
        "phantom",
        "quantity",
        "poses",
        "error [mm]",
        "stated [mm]",
        "covered",
        "always there",
        "largest parts",
    )
    table = Table("coverage", header, [])
    for one in found:
        told = one.stated.report()
        parts = sorted(told["parts"].items(), key=lambda part: -part[1])[:3]
        off = float(np.sqrt((one.off**2).mean()))
        both = (share([one], causes) for causes in (None, ALWAYS))
        table.rows.append(
            (
                one.phantom,
                one.quantity,
                str(len(one.off)),
                f"{off:.2f}",
                f"{told['total']:.2f}",
                *(f"{100 * covered / count:.0f} %" for covered, count in both),
                ", ".join(f"{cause} {part:.2f}" for cause, part in parts),
            )
        )
    for quantity in dict.fromkeys(one.quantity for one in found):
        of_it = [one for one in found if one.quantity == quantity]
        both_of_it = (share(of_it, causes) for causes in (None, ALWAYS))
        shares = [f"{100 * covered / count:.1f} %" for covered, count in both_of_it]
        poses = str(share(of_it)[1])
        table.rows.append(("all", quantity, poses, "", "", *shares, ""))
    return table


def main() -> None:
    """Print the table, and write it where asked to."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rst", type=Path, metavar="FOLDER", help="write the table there as a CSV file")
    asked = parser.parse_args()
    table = coverage_table(list(all_compared(errors=True)))
    print(table.text())
    if asked.rst:
        table.write(asked.rst)


if __name__ == "__main__":
    main()
