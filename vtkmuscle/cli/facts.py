"""What ``vtkmuscle info`` says of a mesh, or of a folder of results."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vtkmuscle.cli.text_facts import text_facts
from vtkmuscle.core.mesh.surface import survey
from vtkmuscle.data.arrays import points_of, triangles_of
from vtkmuscle.io import read_polydata
from vtkmuscle.labels.guesses import LOOK
from vtkmuscle.labels.meshes import likely_unit
from vtkmuscle.run.store import ResultFolder


def _facts_of_run(folder: Path) -> dict[str, str]:
    """Return what is in the folder of a run, also of one that was killed."""
    report = ResultFolder(folder).report()
    if report is None:
        raise ValueError(f"{folder}: this is a folder without the report.json of a run")
    ended = "yes" if report["complete"] else f"no: {report.get('stopped_by') or 'it was killed'}"
    frames = {name: f"{count} frames" for name, count in ResultFolder(folder).frames_there().items()}
    return {"scene": str(report.get("scene")), "complete": ended, **frames}


def facts_of(file: Path) -> dict[str, str]:
    """Return what is known of a file or folder, in words."""
    if file.is_dir():
        return _facts_of_run(file)
    known = text_facts(file)
    if known is not None:
        return dict(known)
    data = read_polydata(file)
    points = points_of(data)
    if not np.isfinite(points).all():
        bad = int((~np.isfinite(points).all(axis=1)).sum())
        return {"points": str(len(points)), "not finite": f"{bad} points; correct them"}
    lowest, highest = points.min(axis=0), points.max(axis=0)
    longest = float((highest - lowest).max())
    bounds = "  ".join(f"{a:.6g} .. {b:.6g}" for a, b in zip(lowest, highest, strict=True))
    size = {"bounds": bounds, "unit": f"{_unit_guess(longest)} (the longest side is {longest:.4g})"}
    if data.GetNumberOfPolys() == 0:
        return {"points": str(len(points)), "polylines": str(data.GetNumberOfLines()), **size}
    try:
        report = survey(points, triangles_of(data, str(file)))
    except ValueError as error:
        return {
            "points": str(len(points)),
            "polygons": str(data.GetNumberOfPolys()),
            "faces": str(error),
            **size,
        }
    side = "outward" if report.volume > 0 else "inward: the surface is inside out"
    return {
        "triangles": str(report.n_triangles),
        "points": f"{report.n_points}" + _but(report.n_unused_points, "belong to no triangle"),
        "closed": _yes(report.closed, f"{report.n_boundary_edges} edges have one triangle"),
        "manifold": _yes(report.manifold, f"{report.n_nonmanifold_edges} edges have more than two triangles"),
        "oriented": _yes(report.oriented, f"{report.n_misoriented_edges} edges disagree")
        + (f", {side}" if report.closed and report.oriented else ""),
        "pieces": str(report.n_components),
        "degenerate": f"{report.n_degenerate_triangles} triangles without area",
        "area": f"{report.area:.6g}",
        "volume": f"{report.volume:.6g}" if report.closed else "none, it is open",
        **size,
    }


def _unit_guess(longest: float) -> str:
    unit, sureness = likely_unit(longest)
    return f"{'probably' if sureness > LOOK else 'perhaps'} {unit}"


def _yes(good: bool, otherwise: str) -> str:
    return "yes" if good else f"no, {otherwise}"


def _but(count: int, what: str) -> str:
    return f", {count} of them {what}" if count else ""
