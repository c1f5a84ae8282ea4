"""``vtkmuscle info``: facts about meshes, results, landmarks, models and motions."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from vtkmuscle.core.attachments.patches import ring_sides
from vtkmuscle.core.errors import InputError, check_is_file
from vtkmuscle.core.mesh.surface import box_of, longest_side, survey
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import MOST_LISTED, listed
from vtkmuscle.data.arrays import joined_triangles, points_of, triangles_of
from vtkmuscle.io import motion_columns, read_landmarks, read_motion_table, read_named_points, read_polydata
from vtkmuscle.io.csv_table import csv_rows
from vtkmuscle.io.motion_table import TRANSFORM_COLUMNS
from vtkmuscle.io.surfaces import stated_frame
from vtkmuscle.joints.osim import read_motion_file
from vtkmuscle.labels.draft import likely_unit
from vtkmuscle.labels.guesses import LOOK
from vtkmuscle.opensim.model import read_osim
from vtkmuscle.run.figures import FORMS
from vtkmuscle.run.store import ResultFolder
from vtkmuscle.scenes import Scene

#: Suffixes of landmarks and of motions.
LANDMARKS, MOTIONS = (".csv", ".json", ".fcsv", ".nrrd"), (".mot", ".sto")


def facts_of(file: Path) -> Mapping[str, str]:
    """Return facts about a file or folder by keyword."""
    if file.is_dir():
        return _of_run(file)
    check_is_file(file)
    kinds = dict.fromkeys(LANDMARKS, _of_landmarks) | dict.fromkeys(MOTIONS, _of_motion)
    kinds |= {".csv": _of_table, ".osim": _of_model, ".toml": lambda file: {"scene": repr(Scene.load(file))}}
    return kinds.get(file.suffix.lower(), _of_mesh)(file)


def draw_landmarks(file: Path, picture: Path) -> None:
    """Draw landmarks from three sides."""
    if file.suffix.lower() not in LANDMARKS:
        raise InputError(file, f"landmarks are drawn, not {file.suffix!r}", "Scene.plot() draws surfaces")
    from vtkmuscle.plotting.sheets import blank_figure, save_figure

    points, closed = read_landmarks(file)
    line = np.vstack([points, points[:1]]) if closed else points
    names = read_named_points(file).names
    figure = blank_figure(12.0, 4.5, "constrained", title=file.name)
    for axes, (across, up) in zip(figure.subplots(1, 3), ((0, 1), (0, 2), (1, 2)), strict=True):
        axes.plot(line[:, across], line[:, up], "-", linewidth=1.0)
        axes.plot(points[:, across], points[:, up], "k.", markersize=4.0)
        if len(points) <= 3 * MOST_LISTED:
            for number, (name, point) in enumerate(zip(names, points, strict=False)):
                axes.annotate((name or str(number)).replace("$", r"\$"), point[[across, up]], fontsize=7)
        axes.set(xlabel="xyz"[across], ylabel="xyz"[up])
        axes.set_aspect("equal", adjustable="datalim")
    if (form := picture.suffix.lower().removeprefix(".")) not in FORMS:
        raise InputError(picture, "unknown format of a picture", f"allowed: {', '.join(FORMS)}")
    save_figure(figure, picture, form)


def _of_landmarks(file: Path) -> dict[str, str]:
    named = read_named_points(file)
    points, closed = read_landmarks(file)
    length = float(ring_sides(points)[: None if closed else -1].sum())
    return {
        "landmarks": str(len(points)),
        "ring": f"yes, {length:.6g} round" if closed else f"no, {length:.6g} along",
        "names": _listed([name for name in named.names if name]),
        "frame": f"{named.frame}, turned to LPS" if named.frame == "RAS" else named.frame or "not said",
        "bounds": _bounds(points),
    }


def _of_table(file: Path) -> dict[str, str]:
    header = next((cells for _, cells in csv_rows(file)), [""])
    if TRANSFORM_COLUMNS[0] not in header:
        return (_of_motion if header[0].casefold() == "time" else _of_landmarks)(file)
    moved, rest = read_motion_table(file, None if "bone" in header else "one"), motion_columns(file)
    return {"poses": str(len(moved.times)), "bones": _listed([*moved.transforms]), "columns": _listed(rest)}


def _of_motion(file: Path) -> dict[str, str]:
    motion = read_motion_file(file)
    units = {True: "degrees", False: "radians", None: "not said"}
    columns = zip(motion.labels, motion.table.T, strict=True)
    ranges = [f"{label} ({column.min():.4g} .. {column.max():.4g})" for label, column in columns]
    rows = f"{len(motion.times)}, {motion.times[0]:g} .. {motion.times[-1]:g} s"
    return {"rows": rows, "angles": units[motion.degrees], "columns": _listed(ranges)}


def _of_model(file: Path) -> dict[str, str]:
    model = read_osim(file)
    tree = model.tree
    lists = {
        "bodies": tree.bodies,
        "joints": [f"{joint.name} ({joint.kind})" for joint in tree.joints],
        "coordinates": [f"{coordinate.name} [{coordinate.unit}]" for coordinate in tree.coordinates],
        "coupled": [f"{pair.dependent} to {pair.independent}" for pair in tree.couplings],
        "muscles": model.muscles,
        "ligaments": model.ligaments,
        "wrapped": [name for name, muscle in model.paths.items() if getattr(muscle.path, "wraps", ())],
        "meshes": [file for _, file in model.meshes],
        "not used": model.not_used,
    }
    facts = {word: _listed(list(names)) for word, names in lists.items() if names}
    return {"model": model.name, **facts, "markers": _listed([*model.markers])}


def _bounds(points: Floats) -> str:
    lowest, highest = box_of(points)
    return "  ".join(f"{a:.6g} .. {b:.6g}" for a, b in zip(lowest, highest, strict=True))


def _listed(names: list[str]) -> str:
    return (f"{len(names)}: " if len(names) > 1 else "") + listed(names)


def _of_run(folder: Path) -> dict[str, str]:
    report = ResultFolder(folder).report()
    if report is None:
        problem = "the folder has no report.json of a run"
        raise InputError(folder, problem, "give a folder of results, or files such as a scene.toml")
    ended = "yes" if report["complete"] else f"no: {report.get('stopped_by') or 'it was killed'}"
    there = ResultFolder(folder).frames_there().items()
    frames = {name: f"{count} frame{'s' * (count != 1)}" for name, count in there}
    return {"scene": str(report.get("scene")), "complete": ended, **frames}


def _of_mesh(file: Path) -> dict[str, str]:
    data, changes = read_polydata(file), list[str]()
    if data.GetNumberOfPolys() + data.GetNumberOfStrips():
        data, changes = joined_triangles(data)
    points = points_of(data)
    if not np.isfinite(points).all():
        bad = int((~np.isfinite(points).all(axis=1)).sum())
        return {"points": str(len(points)), "not finite": f"{bad} points; correct them"}
    longest = longest_side(points)
    unit, confidence = likely_unit(longest)
    surely = "probably" if confidence > LOOK else "perhaps"
    stated = stated_frame(file)
    frame = {"frame": f"{stated}, by the header"} if stated else {}
    size = frame | {"bounds": _bounds(points), "unit": f"{surely} {unit} (the longest side is {longest:.4g})"}
    if data.GetNumberOfPolys() == 0:
        return {"points": str(len(points)), "polylines": str(data.GetNumberOfLines()), **size}
    report = survey(points, triangles_of(data, str(file)))
    loose = report.n_unused_points
    side = ", outward" if report.volume > 0 else ", inward: the surface is inside out"
    side = side if report.closed and report.oriented else ""
    return {
        "triangles": str(report.n_triangles),
        "points": f"{report.n_points}" + (f", {loose} of them belong to no triangle" if loose else ""),
        **({"changed": "; ".join(changes)} if changes else {}),
        "closed": _yes(report.closed, f"{report.n_boundary_edges} edges have one triangle"),
        "manifold": _yes(report.manifold, f"{report.n_nonmanifold_edges} edges have more than two triangles"),
        "oriented": _yes(report.oriented, f"{report.n_misoriented_edges} edges disagree") + side,
        "pieces": str(report.n_components),
        "degenerate": f"{report.n_degenerate_triangles} triangles without area",
        "area": f"{report.area:.6g}",
        "volume": f"{report.volume:.6g}" if report.closed else "none, it is open",
        **size,
    }


def _yes(good: bool, otherwise: str) -> str:
    return "yes" if good else f"no, {otherwise}"
