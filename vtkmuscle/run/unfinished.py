"""What a run that was stopped or killed has left in its folder."""

from __future__ import annotations

from pathlib import Path

from vtkmuscle.run.claim import read_report
from vtkmuscle.run.poses import series_of


def frames_there(folder: Path) -> dict[str, int]:
    """Return how many frames of each muscle a folder of results lists, whatever its report says."""
    report = read_report(folder) or {}
    return {name: _frames(folder, name) for name in report.get("muscles", {})}


def unfinished(folder: Path) -> str | None:
    """Return in words what an unfinished run has left in a folder; None where there is none."""
    report = read_report(folder)
    if report is None or report.get("complete"):
        return None
    counts = frames_there(folder)
    frames = report.get("frames")
    total = f" of {len(frames)}" if isinstance(frames, list) else ""
    listed = ", ".join(f"{name} {count}{total}" for name, count in counts.items()) or "none"
    why = report.get("stopped_by") or "it was killed"
    return f"{folder} holds a run that did not end ({why}); frames there: {listed}"


def _frames(folder: Path, name: str) -> int:
    try:
        series = series_of(folder, name)
    except ValueError:  # damaged
        return 0
    return 0 if series is None else len(series.times)
