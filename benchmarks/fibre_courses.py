"""Ways to fill a muscle with fibres, against each other, measured fibres and dissections.

    python benchmarks/fibre_courses.py [--scenes SCENE...] [--tracts FOLDER] [--rst FOLDER]

``courses``: 100 fibres through planes, through isolines and straight, in phantoms and the muscles of scenes.
``tracts``: 400 fibres of each kind in a muscle whose fibres were measured; the folder has ``muscle.vtp``,
``tracts.vtp``, and the aponeuroses' rings ``origin.vtp`` and ``insertion.vtp``. ``dissection``: fascicles,
pennation and areas of the scenes' muscles, and of that one, beside Ward et al. 2009,
doi:10.1007/s11999-008-0594-8.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from how_right import Floats, Table, phantoms
from scipy.spatial import cKDTree

from vtkmuscle import Scene
from vtkmuscle.core.fibres.measures import arrangement
from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.mesh.polylines import evenly_spaced, polyline_lengths
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.data.arrays import Polylines, field_string, polylines_of
from vtkmuscle.data.attachments import AttachmentArea, aponeuroses_data, attachments_from
from vtkmuscle.data.muscle_geometry import surface_of
from vtkmuscle.filters import FibreSource
from vtkmuscle.io import read_aponeurosis, read_polydata, read_surface
from vtkmuscle.pipelines import decompose
from vtkmuscle.run.report_values import architecture_of

#: Positions in a muscle, places along a fibre that they are near to, and rounds of which the fastest counts.
SAMPLES, DENSE, ROUNDS = 20_000, 200, 3
#: Places along a fibre or tract at which directions are compared.
PLACES = 40
#: Fibres of which the mean direction at a place of a tract is taken, places at each end of it that are left
#: out, and the fewest points of a tract that has a direction.
BESIDE, LEFT_OUT, FEWEST = 8, 2, 8

Way = Callable[..., Any]
WAYS: dict[str, Way] = {
    "planes": lambda muscle, areas, n: decompose(muscle, areas, n_fibres=n, method="plane"),
    "isolines": lambda muscle, areas, n: decompose(
        muscle, areas, n_fibres=n, method="harmonic", end_rule="shared"
    ),
    "straight": lambda muscle, areas, n: FibreSource(
        muscle=muscle, attachments=areas, n_fibres=n, course="straight"
    ),
}

#: Mean and standard deviation over 21 cadavers, Ward et al. 2009, Table 3: fibre length, normalised [mm],
#: pennation [degrees], and the mean PCSA [cm^2] where it was confirmed in a second transcription.
WARD: dict[str, tuple[tuple[float, float], tuple[float, float], float | None]] = {
    "gluteus_maximus": ((156.9, 25.7), (21.9, 26.2), None),
    "gluteus_medius": ((73.3, 15.7), (20.5, 17.3), None),
    "iliacus": ((106.6, 18.6), (14.3, 5.3), None),
    "adductor_brevis": ((103.1, 14.2), (6.1, 3.1), None),
    "semimembranosus": ((69.0, 18.3), (15.1, 3.4), 18.4),
    "semitendinosus": ((193.0, 41.2), (12.9, 4.9), 4.8),
    "biceps_femoris_long": ((97.6, 26.2), (11.6, 5.5), 11.3),
    "biceps_femoris_short": ((110.3, 20.6), (12.3, 3.6), 5.1),
    "gracilis": ((227.8, 43.8), (8.2, 2.5), None),
    "rectus_femoris": ((75.9, 12.8), (13.9, 3.5), 13.5),
}
#: Of the medial gastrocnemius the means alone were confirmed.
WARD_GASTROCNEMIUS = (51.0, 9.9, 21.1)


def muscles_of(paths: list[Path]) -> Iterator[tuple[str, Any, Any]]:
    """Yield names, surfaces and attachments of phantoms, and of the muscles of scenes."""
    for phantom in (phantoms.spindle_over_hinge(), phantoms.lifting_strap(), phantoms.tendon_through_ring()):
        ((name, muscle),) = phantom.muscles.items()
        yield phantom.name, muscle, phantom.attachments[name]
    for scene in map(Scene.load, paths):
        for name, one in scene.muscles.items():
            yield name, one.surface, scene.attachments_data(name)


def course_figures(muscle: Any, areas: Any, way: Way) -> str:
    """Return what fibres leave bare, how they lie, and the time they take, as text."""
    times = []
    for _ in range(ROUNDS):
        start = time.process_time()
        fibres = way(muscle, areas, 100).update().output
        times.append(time.process_time() - start)
    lines, geometry = polylines_of(fibres, "fibres"), surface_of(muscle, "muscle").geometry
    samples, volume = geometry.samples(SAMPLES), signed_volume(geometry.points, geometry.triangles)
    dense = evenly_spaced(lines.points, lines.offsets, DENSE).reshape(-1, 3)
    found = arrangement(lines.points, lines.offsets, samples, volume)
    away = np.percentile(cKDTree(dense).query(samples)[0], 95)
    length = polyline_lengths(lines.points, lines.offsets).mean()
    return (
        f"{away:.1f} / {100 * found.crossing:.0f} / {found.turning:.0f} / {length:.0f} / "
        f"{1e3 * min(times):.0f}"
    )


def courses(paths: list[Path]) -> Table:
    """Return the ways to fill muscles against each other."""
    table = Table("courses", ("muscle", *WAYS, "taken"), [])
    for name, muscle, areas in muscles_of(paths):
        cells = [course_figures(muscle, areas, way) for way in WAYS.values()]
        taken = field_string(FibreSource(n_fibres=100)(muscle, areas), "Course")
        table.rows.append((name.replace("_", " "), *cells, str(taken)))
    return table


def directions(lines: Polylines, left_out: int) -> tuple[Floats, Floats]:
    """Return places evenly along lines, without those at the ends, and the directions there."""
    even = evenly_spaced(lines.points, lines.offsets, PLACES)
    ahead = unit_vectors((even[:, 2:] - even[:, :-2]).reshape(-1, 3)).reshape(len(even), -1, 3)
    kept = slice(left_out, PLACES - 2 - left_out)
    return even[:, 1:-1][:, kept].reshape(-1, 3), ahead[:, kept].reshape(-1, 3)


def angles_between(lines: Polylines, tracts: Polylines) -> Floats:
    """Return the angles between tracts and the mean direction of the fibres beside them [degrees]."""
    places, ahead = directions(tracts, LEFT_OUT)
    known, ways = directions(lines, 0)
    near = ways[cKDTree(known).query(places, BESIDE)[1]]
    near *= np.sign((near * near[:, :1]).sum(axis=-1, keepdims=True))
    cosines = (unit_vectors(near.mean(axis=1)) * ahead).sum(axis=1)
    angles: Floats = np.degrees(np.arccos(np.minimum(np.abs(cosines), 1.0)))
    return angles


def spread(values: Floats, digits: int = 1) -> str:
    """Return the median and the 10th and 90th percentile as text."""
    low, middle, high = np.percentile(values, (10, 50, 90))
    return f"{middle:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def measured_muscle(folder: Path) -> tuple[Any, Any, Any]:
    """Return a muscle's surface, its aponeuroses, and these as areas of attachment."""
    sheets = [
        read_aponeurosis(folder / f"{name}.vtp", side)
        for name, side in (("origin", "proximal"), ("insertion", "distal"))
    ]
    areas = [
        AttachmentArea(role, "bone", sheet.points, closed=True)
        for role, sheet in zip(("origin", "insertion"), sheets, strict=True)
    ]
    return read_surface(folder / "muscle.vtp"), aponeuroses_data(sheets), attachments_from(areas)


def against_tracts(folder: Path) -> Table:
    """Return how near fibres come to measured ones, by angle and by length."""
    muscle, sheets, areas = measured_muscle(folder)
    data = read_polydata(folder / "tracts.vtp")
    data.SetVerts(None)
    every = polylines_of(data, "tracts")
    long = [i for i in range(len(every)) if len(every.line(i)) >= FEWEST]
    kept = [every.line(i) for i in long]
    tracts = Polylines(np.vstack(kept), np.cumsum([0, *map(len, kept)]))
    table = Table("tracts", ("fibres", "angle, 50 / 90 % [deg]", "length [mm]"), [])
    table.rows.append(("measured", "", spread(polyline_lengths(every.points, every.offsets))))
    ways: dict[str, Callable[[], Any]] = {
        "between aponeuroses": lambda: FibreSource(muscle=muscle, aponeuroses=sheets, n_fibres=400)
    }
    ways |= {
        f"{name}, rings as areas": lambda way=way: way(muscle, areas, 400)  # type: ignore[misc]
        for name, way in WAYS.items()
    }
    for name, way in ways.items():
        lines = polylines_of(way().update().output, "fibres")
        angles = np.percentile(angles_between(lines, tracts), (50, 90))
        lengths = polyline_lengths(lines.points, lines.offsets)
        table.rows.append((name, f"{angles[0]:.1f} / {angles[1]:.1f}", spread(lengths)))
    return table


def dissection(paths: list[Path], folder: Path | None) -> Table:
    """Return the architecture of muscles beside that of dissections."""
    header = ("muscle", "volume [cm³]", "rests on", "fascicle [mm]", "Ward: fibre [mm]")
    header += ("pennation [deg]", "Ward: pennation [deg]", "PCSA [cm²]", "Ward: PCSA [cm²]")
    table = Table("dissection", header, [])

    def row(name: str, found: Any, ward: tuple[str, str, str]) -> None:
        fascicle, area = found["fascicle_length_mm"], found["pcsa_without_tendon_mm2"] / 100.0
        ends = [found[f"fascicle_pennation_{end}_deg"] for end in ("origin", "insertion")]
        table.rows.append(
            (
                name.replace("_", " "),
                f"{found['muscle_volume_mm3'] / 1000.0:.0f}",
                found["tendon_from"],
                f"{fascicle['mean']:.0f}, sd {fascicle['sd']:.0f}",
                ward[0],
                " and ".join(f"{end['mean']:.0f}" for end in ends),
                ward[1],
                f"{area:.1f}",
                ward[2],
            )
        )

    if folder is not None:
        muscle, sheets, _ = measured_muscle(folder)
        fibres = FibreSource(muscle=muscle, aponeuroses=sheets, n_fibres=400).update().output
        ward = tuple(map(str, WARD_GASTROCNEMIUS))
        found = architecture_of(fibres, muscle, 1.0, between_aponeuroses=True)
        row("gastrocnemius medialis", found, (ward[0], ward[1], ward[2]))
    for scene in map(Scene.load, paths):
        result = scene.run(None, frames="0:1", figures=False)
        for name in result.muscle_names:
            if name in WARD:
                length, angle, area = WARD[name]
                words = [f"{mean:.0f}, sd {sd:.0f}" for mean, sd in (length, angle)]
                known = (words[0], words[1], "" if area is None else str(area))
                # Without the name: the population's ratio comes from these dissections.
                at_rest = result.track(name)
                found = architecture_of(at_rest.rest_fibres, at_rest.rest, scene.millimetres)
                row(name, found, known)
    return table


def main() -> None:
    """Print the tables, and write them where asked to."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", type=Path, nargs="+", default=[], metavar="SCENE", help="scene.toml")
    parser.add_argument("--tracts", type=Path, metavar="FOLDER", help="a muscle with measured fibres")
    parser.add_argument("--rst", type=Path, metavar="FOLDER", help="write the tables there as CSV files")
    asked = parser.parse_args()
    tables = [courses(asked.scenes)]
    if asked.tracts:
        tables.append(against_tracts(asked.tracts))
    if asked.tracts or asked.scenes:
        tables.append(dissection(asked.scenes, asked.tracts))
    for table in tables:
        print(table.text(), end="\n\n")
        if asked.rst:
            table.write(asked.rst)


if __name__ == "__main__":
    main()
