"""What errors of mean moment arms and lengths hold: on the phantoms that decide their law, and on others.

    python benchmarks/stated_errors.py --rst docs/validation/how_right_tables

The law is :func:`vtkmuscle.core.fibres.measures.mean_errors`. The coefficient of the model's part is the
least that covers 95 % of the poses of each phantom of ``how_right.py`` without via rings. Each of these
phantoms is tried with the coefficient of all others, the phantoms of ``benchmarks/held_out.py`` with the
package's. docs/validation/how_right.rst shows the tables.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from held_out import held_out
from how_right import N_FIBRES, Floats, Known, Table, _by_angle, _by_coordinate, known_phantoms, phantoms
from scipy.interpolate import CubicSpline

from vtkmuscle.core.fibres.measures import MODEL
from vtkmuscle.core.moment_arms.of_joints import ErrorSources, joint_arms
from vtkmuscle.core.paths.sheet import POINTS
from vtkmuscle.data.arrays import cell_array
from vtkmuscle.data.paths import levers_over_time
from vtkmuscle.pipelines import MusclePipeline
from vtkmuscle.run.frames import MuscleTrack

#: Quantities with an error: the mean moment arm, and the mean change of length since rest.
KINDS = ("arm", "length")
#: Part of the poses in which an error is to hold.
HELD = 0.95
#: Part of a phantom's poses in which an error that others decided is to hold.
MOST = 0.9
#: Angles of phantoms with two coordinates, from rest [degrees].
SWEEPS = {"flexion": (0, 51, 2), "abduction": (0, -31, -2), "upper": (0, 61, 4), "lower": (0, 91, 4)}


@dataclass
class Stated:
    """True and stated errors of a quantity in each pose, (k,) [mm]; parts as of ``mean_errors``."""

    true: Floats
    parts: dict[str, Floats]

    def total(self, coefficient: float = MODEL) -> Floats:
        """Return the stated error with another coefficient of the model's part."""
        model = self.parts["model"] * coefficient / MODEL
        return np.sqrt(model**2 + self._known)

    @property
    def _known(self) -> Floats:
        """The sum of squares of all parts but the model's."""
        return np.square([self.parts[part] for part in ("sampling", "numerical", "bow")]).sum(axis=0)

    @property
    def needed(self) -> float:
        """The least coefficient that covers 95 % of the poses."""
        rest = np.maximum(self.true**2 - self._known, 0.0)
        model = self.parts["model"] / MODEL
        return float(np.quantile(np.sqrt(rest)[model > 0.0] / model[model > 0.0], HELD, method="lower"))

    def covered(self, coefficient: float = MODEL) -> float:
        """Return the part of the poses, but rest, that is covered."""
        return float((self.true <= self.total(coefficient))[self.parts["model"] > 0.0].mean())

    def overstated(self, coefficient: float = MODEL) -> float:
        """Return the median stated error over the 95th percentile of the true error."""
        return float(np.median(self.total(coefficient)) / np.quantile(self.true, HELD))


def held_out_phantoms() -> Iterator[Known]:
    """Yield the phantoms that decided nothing, each while its sizes hold."""
    for name, phantom, coordinate in held_out():
        if coordinate is not None:
            number = list(phantom.known["coordinates"]).index(coordinate)
            make = getattr(phantoms, phantom.name)
            case = _by_coordinate(make, number, np.arange(*map(float, SWEEPS[coordinate])))
            yield replace(case, name=f"{name}, {coordinate}")
            continue
        times = phantom.motion.times
        if "moment_arm" in phantom.known:
            yield replace(_by_angle(name, phantom, times), name=name)
        else:
            lengths = np.array([phantom.known["length"](time) for time in times])
            yield Known(name, phantom, times, times, lengths, "length")


def stated(case: Known, n_fibres: int = N_FIBRES, **paths: int) -> dict[str, Stated]:
    """Return the errors of the mean arm, where it is known, and of the mean change of length."""
    ((name, muscle),) = case.phantom.muscles.items()
    given = muscle, case.phantom.bones, case.motion, case.phantom.attachments[name]
    settings = {"fixing": {}, "fibres": {"n_fibres": n_fibres}, "paths": paths}
    taut = MusclePipeline(*given, deformer="none", **settings).taut_paths
    track, rest, sags = MuscleTrack(), int(np.abs(case.places).argmin()), np.zeros(len(case.motion.times))
    for number, time in enumerate(case.motion.times):
        paths = taut.update(time=float(time)).output
        track.add_lengths(paths, 1.0)
        sags[number] = np.percentile(cell_array(paths, "Sag", "paths"), 95)
    change, found = np.mean(track.lengths, axis=1) - track.rest_lengths.mean(), {}
    known = case.answers
    if case.quantity == "moment arm":
        sources = ErrorSources(track.ratios, levers_over_time(track.bows), sags)
        (arms,) = joint_arms(track.lengths, track.levers(), case.motion, sources=sources)[0].values()
        found["arm"] = Stated(np.abs(arms.mean - case.answers[arms.frames]), dict(arms.errors))
        order = np.argsort(case.places)
        angles = np.radians(case.places)
        known = -CubicSpline(angles[order], case.answers[order]).antiderivative()(angles)
    return found | {"length": Stated(np.abs(change - (known - known[rest])), track.errors())}


def tables(**settings: int) -> tuple[Table, Table]:
    """Return true and stated errors by phantom, and what the stated errors cover."""
    fitted = {case.name: stated(case, **settings) for case in known_phantoms()}
    others = {case.name: stated(case, **settings) for case in held_out_phantoms()}
    decide = {name: found for name, found in fitted.items() if "ring" not in name}
    columns = [f"{kind}: {what}" for kind in KINDS for what in ("error [mm]", "stated [mm]", "covered")]
    rows = Table("stated", ("phantom", "coefficient of", *columns), [])
    judged: dict[tuple[str, str], list[tuple[float, float, int]]] = {}
    for name, found in (fitted | others).items():
        group = "no phantom" if "ring" in name else "all others" if name in decide else "the package"
        row = [name, group]
        for kind in KINDS:
            if kind not in found:
                row += [""] * 3
                continue
            one, coefficient = found[kind], MODEL
            if name in decide:
                coefficient = max(f[kind].needed for n, f in decide.items() if n != name and kind in f)
            covered = one.covered(coefficient)
            sizes = np.quantile(one.true, HELD), np.median(one.total(coefficient))
            row += [*(f"{size:.2f}" for size in sizes), f"{100 * covered:.0f} %"]
            counted = covered, one.overstated(coefficient), len(one.true)
            judged.setdefault((group, kind), []).append(counted)
        rows.rows.append(row)
    header = ("coefficient of", "of", "covered poses", "phantoms with 90 % or more", "stated / true, median")
    summary = Table("stated_cover", header, [])
    for key, values in judged.items():
        covered, over, counts = np.array(values).T
        share, many = 100 * np.average(covered, weights=counts), f"{np.sum(covered >= MOST)} of {len(over)}"
        summary.rows.append((*key, f"{share:.0f} %", many, f"{np.median(over):.1f}"))
    for kind in KINDS:
        needed = max(found[kind].needed for found in decide.values() if kind in found)
        print(f"{kind}: coefficient {needed:.2f}, the package's is {MODEL}")
    return rows, summary


def main() -> None:
    """Print the table, and write it where asked to."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rst", type=Path, metavar="FOLDER", help="write the tables there as CSV files")
    parser.add_argument("--fibres", type=int, default=N_FIBRES, help="number of fibres of each phantom")
    parser.add_argument("--resolution", type=int, default=POINTS - 1, help="segments of a path")
    asked = parser.parse_args()
    for made in tables(n_fibres=asked.fibres, resolution=asked.resolution):
        print(made.text(), end="\n\n")
        if asked.rst:
            made.write(asked.rst)


if __name__ == "__main__":
    main()
