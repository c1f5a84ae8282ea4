"""How right lengths and moment arms are: phantoms with known answers, and a real hip against the literature.

    python benchmarks/how_right.py
    python benchmarks/how_right.py --rst docs/validation/how_right_tables
    python benchmarks/how_right.py --hip FOLDER --rst docs/validation/how_right_tables
    python benchmarks/how_right.py --knee FOLDER --rst docs/validation/how_right_tables

Each figure is given twice: of the muscle's *paths*, bone to bone, whose moment arms are levers, and of the
*fibres* that PathDeformer carries, whose moment arms are -dl/dq; both with their defaults.
``--hip`` names a folder of the LHDL hip, with ``scene.toml``,
``motions`` and ``reference``, ``--knee`` one of a knee with a hinge in its ``scene.toml``. The page
docs/validation/how_right.rst says what is measured.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vtkmuscle import RigidMotion, Scene
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.moment_arms.of_joints import joint_arms, quartic_moment_arms, slopes_by
from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.data.arrays import polylines_of
from vtkmuscle.data.paths import levers_over_time, paths_of
from vtkmuscle.io import curves_for, read_literature
from vtkmuscle.phantoms import Phantom
from vtkmuscle.pipelines import MusclePipeline

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
import phantoms

Floats = NDArray[np.float64]

#: What lengths and moment arms are of, as the tables call it.
OF = ("paths", "fibres")

#: Fibres that each phantom gets, and settings of them that follow sharp bends better than the defaults do.
N_FIBRES = 30
FINE: dict[str, Any] = {"method": "harmonic", "resolution": 40}

#: Rows that a phantom has in the table of known answers.
HANDFUL = 5

#: Motions of the hip: table, and the range that quartics are fitted over [degrees].
SWEEPS = {
    "hip_flexion": ("hip_flexion_osim_-10_90", (-10.0, 60.0)),
    "hip_adduction": ("hip_adduction_osim_-40_40", (-40.0, 40.0)),
    "hip_rotation": ("hip_rotation_osim_-30_30", (-30.0, 30.0)),
}
MUSCLES = ("iliacus", "gluteus_maximus")
ENVELOPE = "Blemker2005"

#: Fibre lengths of Modenese and Kohout 2020, which are compared as well where they are there; some of their
#: rows belong to other angles than they say.
LINEAR_BLEND, LAGGING = "mk2020_fibre_length_mm_{}_{}.csv", slice(10, 15)


@dataclass
class Table:
    """Rows of text under a header."""

    name: str
    header: Sequence[str]
    rows: list[Sequence[str]]

    def text(self) -> str:
        """Return it in columns of equal width."""
        lines = [self.header, *self.rows]
        widths = [max(len(line[i]) for line in lines) for i in range(len(self.header))]
        return "\n".join(
            "  ".join(c.ljust(w) for c, w in zip(x, widths, strict=True)).rstrip() for x in lines
        )

    def write(self, folder: Path) -> None:
        """Write it for a ``csv-table`` of the documentation."""
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / f"{self.name}.csv").open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows([self.header, *self.rows])


@dataclass
class Measured:
    """Lengths and moment arms of a muscle in each frame.

    Attributes
    ----------
    lengths : dict of str to (f, k) array
        Of the paths and of the fibres [mm].
    levers : dict of str to (f, k) array
        Of the paths, by coordinate.
    motion : RigidMotion
        With one coordinate.
    """

    lengths: dict[str, Floats]
    levers: dict[str, Floats]
    motion: RigidMotion

    @property
    def arms(self) -> dict[str, Floats]:
        """Of the paths their levers, of the fibres -dl/dq by differences, in the frames of the sweep [mm]."""
        (name,) = self.motion.coordinates
        (levers,) = joint_arms(self.lengths["paths"], self.levers, self.motion)[0].values()
        slopes = slopes_by(self.motion, name, (name,), self.lengths["fibres"], 1)
        return {"paths": levers.arms, "fibres": slopes[levers.frames]}


def measured(
    muscle: Any, bones: Any, attachments: Any, motion: RigidMotion, **fibre_settings: Any
) -> Measured:
    """Return what is measured of a muscle's paths and fibres over a motion."""
    chain = MusclePipeline(muscle, bones, motion, attachments, fixing={}, fibres=fibre_settings).metrics
    assert chain is not None  # it has fibres
    lengths: dict[str, list[Floats]] = {of: [] for of in OF}
    found = []
    for time in motion.times:
        fibres = chain.update(time=float(time)).output
        lines, paths = polylines_of(fibres, "fibres"), paths_of(fibres, "fibres")
        assert paths is not None  # they carry the muscle
        lengths["fibres"].append(polyline_lengths(lines.points, lines.offsets))
        lengths["paths"].append(paths.lengths)
        found.append(paths.levers)
    return Measured({of: np.array(rows) for of, rows in lengths.items()}, levers_over_time(found), motion)


# ---------------------------------------------------------------------- phantoms


@dataclass
class Known:
    """A phantom along a way, and what is known there.

    Attributes
    ----------
    name : str
        In the tables.
    phantom : Phantom
    times : (k,) array
        Of its motion, one frame each, in the order that they are gone through.
    places : (k,) array
        How far along that is: an angle [degrees], or a pull [mm].
    answers : (k,) array
        The moment arm, or the length, at each place [mm].
    quantity : str
        Which of the two.
    """

    name: str
    phantom: Phantom
    times: Floats
    places: Floats
    answers: Floats
    quantity: str = "moment arm"

    @property
    def motion(self) -> RigidMotion:
        """The phantom's, along the way, which is its coordinate."""
        poses = [self.phantom.motion.at(time) for time in self.times]
        transforms = {bone: np.array([pose[bone] for pose in poses]) for bone in poses[0]}
        way = Coordinate(self.places, "deg" if self.quantity == "moment arm" else "mm")
        return RigidMotion(np.arange(float(len(poses))), transforms, self.phantom.motion.centre, {"way": way})

    def means(self, found: Measured) -> dict[str, Floats]:
        """Return the means over paths and over fibres, (k,) each, of what the answers are."""
        given = found.lengths if self.quantity == "length" else found.arms
        return {of: values.mean(axis=1) for of, values in given.items()}


def _by_angle(name: str, phantom: Phantom, angles: Floats) -> Known:
    arm = phantom.known["moment_arm"]
    known = np.array([arm(float(angle)) if callable(arm) else arm for angle in angles])
    return Known(name, phantom, angles, angles, known)


def _by_coordinate(make: Callable[..., Phantom], number: int, angles: Floats) -> Known:
    """Return a phantom of two coordinates, one of which goes through some angles from rest."""
    poses = np.zeros((len(angles), 2))
    poses[:, number] = angles
    phantom = make(coordinates=poses)
    known: Any = phantom.known
    coordinate = list(known["coordinates"])[number]
    arm = known[f"moment_arm_{coordinate}"]
    answers = np.array([arm(*pose) if callable(arm) else arm for pose in poses])
    return Known(f"{phantom.name}, {coordinate}", phantom, phantom.motion.times, angles, answers)


def known_phantoms() -> Iterator[Known]:
    """Yield the phantoms whose answers are known."""
    around = phantoms.wrapping_cylinder(angles=np.arange(-60.0, 81.0, 4.0))
    yield _by_angle("wrapping_cylinder, wound", around, np.arange(0.0, 81.0, 4.0))
    yield _by_angle("wrapping_cylinder, unwound", around, np.arange(0.0, -61.0, -4.0))
    strap, brim, ring = phantoms.lifting_strap(), phantoms.flexor_over_brim(), phantoms.tendon_through_ring()
    yield _by_angle("lifting_strap", strap, strap.motion.times)
    for number, last in enumerate((60.0, 90.0)):
        yield _by_coordinate(phantoms.strap_over_two_joints, number, np.arange(0.0, last + 1.0, 3.0))
    yield _by_angle("flexor_over_brim", brim, brim.motion.times)
    ridge = phantoms.flexor_over_brim(groove=-5.0)
    yield _by_angle("flexor_over_brim, ridge", ridge, ridge.motion.times)
    for number, last in enumerate((60.0, 20.0)):
        yield _by_coordinate(phantoms.spindle_over_ball, number, np.arange(0.0, last + 1.0, 2.0))
    yield _by_angle("tendon_through_ring", ring, ring.motion.times)
    sliver = phantoms.slivered_tendon()
    pulls = sliver.motion.times
    length: Any = sliver.known["length"]
    yield Known("slivered_tendon", sliver, pulls, pulls, np.array([length(p) for p in pulls]), "length")
    for make in (
        phantoms.strap_along_bone,
        phantoms.broad_origin,
        phantoms.strap_beside_bone,
        phantoms.tendon_between_bones,
        phantoms.tendon_under_band,
    ):
        trap = make()
        yield _by_angle(trap.name, trap, trap.motion.times)


def phantom_tables(**fibre_settings: Any) -> tuple[Table, Table]:
    """Return known against measured answers at a handful of poses, and the errors over all poses."""
    at = Table("phantoms", ("phantom", "at", "known [mm]", *(f"{of} [mm]" for of in OF)), [])
    header = ("phantom", "poses", "known", "known [mm]")
    errors = [f"{of}: {which} error [mm]" for of in OF for which in ("mean", "largest")]
    worst = Table("errors", (*header, *errors), [])
    for case in known_phantoms():
        print(f"{case.name} ...", file=sys.stderr, flush=True)
        ((name, muscle),) = case.phantom.muscles.items()
        areas = case.phantom.attachments[name]
        given = muscle, case.phantom.bones, areas, case.motion
        found = case.means(measured(*given, n_fibres=N_FIBRES, **fibre_settings))
        known, ours = case.answers, [found[of] for of in OF]
        for frame in np.linspace(0, len(known) - 1, HANDFUL).round().astype(int):
            values = (known[frame], *(own[frame] for own in ours))
            at.rows.append((case.name, f"{case.places[frame]:g}", *(f"{value:.1f}" for value in values)))
        span = " to ".join(dict.fromkeys(f"{value:.1f}" for value in (known.min(), known.max())))
        off = [own - known for own in ours]
        told = [f"{value:+.2f}" for error in off for value in (error.mean(), error[np.abs(error).argmax()])]
        worst.rows.append((case.name, str(len(known)), case.quantity, span, *told))
    return at, worst


# -------------------------------------------------------------------------- hip


def hip_table(folder: Path) -> Table:
    """Return how the moment arms of two muscles of a real hip compare with a published envelope."""
    scene = Scene.load(folder / "scene.toml")
    curves = read_literature(folder / "reference" / "literature_moment_arms_iliacus_gluteus_maximus.csv")
    header = ("muscle", "coordinate", "of", "mean [mm]", "literature [mm]", "covered", "precision", "IoU")
    table = Table("hip", header, [])
    for name in MUSCLES:
        muscle, areas = scene.muscles[name], scene.attachments_data(name)
        for coordinate, (sweep, span) in SWEEPS.items():
            print(f"{name}, {coordinate} ...", file=sys.stderr, flush=True)
            motion, first = _swept(folder / "motions", sweep, f"{coordinate}_r", span, scene)
            settings = muscle.fibres or {}
            found = measured(muscle.surface, scene.bones_data(), areas, motion, **settings)
            angles = motion.coordinates[f"{coordinate}_r"].values[first:]
            known = curves_for(curves, muscle=name, coordinate=coordinate)
            sides = [curve for curve in known if curve.source == ENVELOPE]
            grid, low, high = _envelope(sides, span)
            levers = found.arms["paths"][-len(angles) :]
            arms = {"paths": np.array([np.interp(grid, angles, one) for one in levers.T]).T}
            samples = {"fibres": (found.lengths["fibres"][first:], angles)}
            published = folder / "reference" / LINEAR_BLEND.format(name, coordinate)
            if published.is_file():
                samples["linear blend 2020"] = _published(published, span)
            for of, (lengths, at) in samples.items():
                arms[of], _ = quartic_moment_arms(lengths, np.radians(at), at=np.radians(grid))
            for of, ours in arms.items():
                parts = overlap(ours.min(axis=1), ours.max(axis=1), low, high)
                told = (f"{ours.mean():.1f}", f"{(low + high).mean() / 2.0:.1f}")
                shares = (f"{100 * part:.0f} %" for part in parts)
                table.rows.append((name, coordinate, of, *told, *shares))
    return table


def overlap(low: Floats, high: Floats, known_low: Floats, known_high: Floats) -> tuple[float, float, float]:
    """Return the common area of two bands as part of the known one, of the first, and of their union."""
    common = np.clip(np.minimum(high, known_high) - np.maximum(low, known_low), 0.0, None).sum()
    own, known = (high - low).sum(), (known_high - known_low).sum()
    return common / known, common / own, common / (own + known - common)


def _envelope(sides: Sequence[Any], span: tuple[float, float]) -> tuple[Floats, Floats, Floats]:
    """Return angles [degrees] within the span and both sides of a published band, as quartics, there."""
    start = max(span[0], *(side.angles.min() for side in sides))
    stop = min(span[1], *(side.angles.max() for side in sides))
    grid = np.linspace(start, stop, 401)
    fits = [np.polynomial.Polynomial.fit(side.angles, side.arms, 4)(grid) for side in sides]
    return grid, np.min(fits, axis=0), np.max(fits, axis=0)


def _published(path: Path, span: tuple[float, float]) -> tuple[Floats, Floats]:
    """Return lengths (poses, fibres) [mm] of a table, and their angles [degrees], within the span."""
    rows = np.delete(np.loadtxt(path, delimiter=",", skiprows=1), LAGGING, axis=0)
    rows = rows[(rows[:, 0] >= span[0]) & (rows[:, 0] <= span[1])]
    return rows[:, 1:], rows[:, 0]


def _swept(
    folder: Path, sweep: str, coordinate: str, span: tuple[float, float], scene: Scene
) -> tuple[RigidMotion, int]:
    """Return a motion from rest by the neutral pose to a sweep and along it, and the first frame of that."""
    to_neutral = _poses(folder / "rest_to_neutral.csv", coordinate)
    along = [row for row in _poses(folder / f"{sweep}.csv", coordinate) if span[0] <= row[0] <= span[1]]
    neutral = int(np.argmin([abs(angle) for angle, _ in along]))
    lead = [*to_neutral[:-1], *along[neutral:0:-1]]
    angles, transforms = (np.array(column) for column in zip(*lead, *along, strict=True))
    (bone,) = scene.motion.transforms
    times, centre = np.arange(float(len(transforms))), scene.motion.centre
    motion = RigidMotion(times, {bone: transforms}, centre, {coordinate: Coordinate(angles)})
    return motion, len(lead)


def _poses(path: Path, coordinate: str) -> list[tuple[float, Floats]]:
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    cells = [f"T{i}{j}" for i in range(4) for j in range(4)]
    return [(float(row[coordinate]), np.array([float(row[c]) for c in cells]).reshape(4, 4)) for row in rows]


# ------------------------------------------------------------------------- knee


def knee_table(folder: Path) -> Table:
    """Return moment arms of the muscles over a hinge: levers of paths, and -dl/dq of paths and of fibres."""
    scene = Scene.load(folder / "scene.toml")
    angles, motion = scene.motion.times, scene.motion
    shown = np.linspace(0, len(angles) - 1, HANDFUL).round().astype(int)
    header = ("muscle", "what", *(f"at {angles[frame]:g}" for frame in shown), "largest difference [mm]")
    table = Table("knee", header, [])
    for name, muscle in scene.muscles.items():
        print(f"{name} ...", file=sys.stderr, flush=True)
        areas = scene.attachments_data(name)
        found = measured(muscle.surface, scene.bones_data(), areas, motion, **(muscle.fibres or {}))
        slopes = -np.gradient(found.lengths["paths"], np.radians(angles), axis=0, edge_order=2)
        levers = found.arms["paths"].mean(axis=1)
        for what, arms in (
            ("paths, levers", levers),
            ("paths, -dl/dq", slopes.mean(axis=1)),
            ("fibres, -dl/dq", found.arms["fibres"].mean(axis=1)),
        ):
            off = f"{np.abs(arms - levers).max():.1f}"
            table.rows.append((name, what, *(f"{arms[frame]:.1f}" for frame in shown), off))
    return table


def main() -> None:
    """Print the tables, and write them where asked to."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--hip", type=Path, metavar="FOLDER", help="the LHDL hip, instead of the phantoms")
    parser.add_argument("--knee", type=Path, metavar="FOLDER", help="a knee, instead of the phantoms")
    parser.add_argument("--rst", type=Path, metavar="FOLDER", help="write the tables there as CSV files")
    parser.add_argument("--fine", action="store_true", help="phantoms with finer fibres, along isolines")
    asked = parser.parse_args()
    tables: Sequence[Table] = [
        *([hip_table(asked.hip)] if asked.hip else []),
        *([knee_table(asked.knee)] if asked.knee else []),
    ]
    if not tables:
        tables = phantom_tables(**(FINE if asked.fine else {}))
    for table in tables:
        print(table.text(), end="\n\n", flush=True)
        if asked.rst:
            table.write(asked.rst)


if __name__ == "__main__":
    main()
