"""Measure what each term and constant of the paths decides: left out, by half and by double.

Run as ``python benchmarks/path_constants.py [--write FILE]``. For each, the largest errors of the paths on
the phantoms of ``how_right.py``: their mean, and the worst phantom.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from how_right import N_FIBRES, Known, Table, known_phantoms

from vtkmuscle.core.paths import bone_contact, neighbours, pose, ring_contact, surroundings
from vtkmuscle.data.paths import paths_of
from vtkmuscle.pipelines import MusclePipeline

#: Modules that know a constant, its name, what it is, and whether it may be 0.
CONSTANTS = (
    ((neighbours,), "MODULUS", "modulus across the paths", False),
    ((neighbours,), "SHEAR_MODULUS", "shear modulus along the paths", True),
    ((neighbours,), "LEAST_SPACING", "least distance of paths, for their stiffness", False),
    ((surroundings,), "LARGEST_STANDOFF", "largest distance kept from a bone", False),
    ((surroundings,), "BUNDLE", "width of a bundle that bows", False),
    ((surroundings,), "ASIDE", "stiffness beside a path on a bone", False),
    ((surroundings,), "THICKNESS_SMOOTHING", "smoothing of the tissue's thickness", True),
    ((bone_contact, pose, ring_contact), "PUSH", "stiffness of bones", False),
    ((bone_contact,), "ROUNDING", "rounding of their contact", False),
)


def _equal_shares(distances: Any) -> Any:
    return np.full(distances.shape, 1.0 / max(len(distances), 1))


def _own_values(values: Any, fibres: Any, width: float) -> Any:
    return values


#: Of the tissue: the function that a term is, what is left out, and what is in place of it.
TERMS = (
    ("shares_by_distance", "shares of tissue by distance (equal ones instead)", _equal_shares),
    ("_bundle_means", "the bundle (each fibre's own bow instead)", _own_values),
    (
        "stiffness_aside",
        "tissue aside of what lies on a bone",
        lambda *given: 0.0 * surroundings_aside(*given),
    ),
    ("stiffness_of_bow", "stiffness of the bow", lambda *given: 0.0 * surroundings_bow(*given)),
    ("stiffness_of_bow", "half of the bow's stiffness", lambda *given: 0.5 * surroundings_bow(*given)),
)
surroundings_aside, surroundings_bow = surroundings.stiffness_aside, surroundings.stiffness_of_bow


@contextmanager
def changed(modules: Sequence[object], name: str, value: object) -> Iterator[None]:
    """Let a name of modules have another value."""
    before = getattr(modules[0], name)
    try:
        for module in modules:
            setattr(module, name, value)
        yield
    finally:
        for module in modules:
            setattr(module, name, before)


def largest_error(case: Known) -> float:
    """Return the largest error of the paths of a phantom over its poses [mm]."""
    ((name, muscle),) = case.phantom.muscles.items()
    given = muscle, case.phantom.bones, case.motion, case.phantom.attachments[name]
    pulled = MusclePipeline(*given, fixing={}, fibres={"n_fibres": N_FIBRES}).taut_paths
    assert pulled is not None  # it has fibres
    found = []
    for time in case.motion.times:
        paths = paths_of(pulled.update(time=float(time)).output, case.name)
        assert paths is not None
        found.append(paths.lengths if case.quantity == "length" else paths.levers["way"])
    return float(np.abs(np.mean(found, axis=1) - case.answers).max())


def row(what: str, value: str, times: str) -> tuple[str, ...]:
    """Return a row of the table: the mean of the largest errors, and the worst phantom [mm]."""
    largest = {case.name: largest_error(case) for case in known_phantoms()}
    unsettled = [name for name, error in largest.items() if np.isnan(error)]
    worst = max(largest, key=lambda name: largest[name])
    found = (f"{np.mean([*largest.values()]):.2f}", f"{largest[worst]:.1f}", worst)
    found = ("", "", f"{unsettled[0]} does not come to rest") if unsettled else found
    print(what, times, *found, file=sys.stderr, flush=True)
    return what, value, times, *found


def main() -> None:
    """Print the table, and write it where asked to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", type=Path, metavar="FILE", help="write it there as CSV")
    asked = parser.parse_args()
    header = ("term or constant", "value", "times", "mean [mm]", "worst [mm]", "of")
    table = Table(asked.write.stem if asked.write else "constants", header, [row("as it is", "", "1")])
    for name, what, instead in TERMS:
        with changed((surroundings,), name, instead):
            table.rows.append(row(what, "", "0.5" if what.startswith("half") else "0"))
    for modules, name, what, may_vanish in CONSTANTS:
        value = getattr(modules[0], name)
        for factor in (*((0.0,) if may_vanish else ()), 0.5, 2.0):
            with changed(modules, name, factor * value):
                table.rows.append(row(what, f"{value:.3g}", f"{factor:g}"))
    print(table.text())
    if asked.write:
        table.write(asked.write.parent)


if __name__ == "__main__":
    main()
