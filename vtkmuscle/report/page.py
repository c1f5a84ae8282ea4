"""The report of a run as a self-contained page."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from vtkmuscle.core.motion.coordinates import ANGLES
from vtkmuscle.io.writing import write_text
from vtkmuscle.report.curves import colour_of, curves_of, label_of
from vtkmuscle.report.scene3d import Pack, scene_of
from vtkmuscle.report.sections import part, rendered
from vtkmuscle.report.tables import errors_of, number, run_tables_of, settings_of, tables_of

if TYPE_CHECKING:
    from vtkmuscle.run.result import Result

#: Number of muscles above which the cards are collapsed.
MANY = 6
#: Verdicts in words.
BADGES = {"ok": "✓ ok", "look": "! check this", "failed": "✗ failed"}
#: Basis of a muscle's cross-sectional area, in words.
RESTS_ON = {
    "aponeuroses": "fibres between aponeuroses",
    "scene": "fibres bone to bone, less the scene's tendon",
    "population": "fibres bone to bone, less the tendon of published muscles of this name",
    "estimate": "fibres bone to bone, less an estimated tendon",
}
#: Parts of the page's program, in loading order.
_SCRIPTS = (
    *("arrays.js", "webgl.js", "shaders.js", "colours.js", "shapes.js", "camera.js", "viewer.js"),
    *("saving.js", "charts.js", "curves.js", "page.js"),
)


def write_page(path: str | PathLike[str], run: Result) -> Path:
    """Write the page of a run as an .html file. The file needs no external resources."""
    write_text(Path(path), page_of(run))
    return Path(path)


def page_of(run: Result) -> str:
    """Return the page of a run as text, see :func:`write_page`."""
    report, pack = run.report, Pack()
    scene = scene_of(run, pack)
    curves = curves_of(run, pack)
    muscles = [_card(run, number, name) for number, name in enumerate(run.muscle_names)]
    lengths, fibre_lengths = bool(run.lengths), bool(run.fibre_lengths)
    return rendered(
        "report.html",
        name=report["scene"],
        script=Markup("\n").join(map(part, _SCRIPTS)),
        span=[number(run.times[0]), number(run.times[-1])],
        summary=_summary(run),
        stopped=report.get("stopped_by") if not report["complete"] else None,
        warnings=report.get("sense", ()),
        badge=BADGES,
        compact=len(muscles) > MANY,
        muscles=muscles,
        alt=f"The scene in three dimensions: {', '.join(muscle['label'] for muscle in muscles)}, "
        f"and the bones {', '.join(bone['name'] for bone in scene['bones'])}.",
        surfaces=report["deformer"] != "none",
        fibres=fibre_lengths,
        curves=lengths or fibre_lengths or bool(curves["checks"]),
        lengths=lengths,
        fibre_lengths=fibre_lengths,
        arms=any(run.all_arms.values()),
        checks=curves["checks"],
        coordinates=curves["coordinates"],
        time_label=run.time_label,
        last=len(scene["shown"]) - 1,
        tables=tables_of(report),
        trust=errors_of(report),
        run_tables=run_tables_of(report),
        settings=settings_of(report),
        definitions=list(report["definitions"].items()),
        data={"scene": scene, "curves": curves, "frames": list(run.frames)},
        arrays=Markup(pack.text()),
    )


def _summary(run: Result) -> str:
    """Return which muscles can be used."""
    groups = {
        verdict: [label_of(name) for name, own in run.verdicts.items() if own == verdict]
        for verdict in BADGES
    }
    words = []
    if len(groups["ok"]) == len(run.muscle_names):
        words.append("All checks passed.")
    elif groups["ok"]:
        words.append(f"Passed all checks: {_listed(groups['ok'])}.")
    if groups["look"]:
        words.append(f"Check the findings below before use: {_listed(groups['look'])}.")
    if groups["failed"]:
        words.append(f"Do not use: {_listed(groups['failed'])}.")
    return " ".join(words)


def _listed(names: list[str]) -> str:
    return ", ".join(names[:-1]) + (" and " if len(names) > 1 else "") + names[-1]


def _card(run: Result, position: int, name: str) -> dict[str, Any]:
    muscle = run.report["muscles"][name]
    facts: list[tuple[str, str, list[str] | None]] = []
    for title, lengths in (
        ("mean length, bone to bone", run.lengths),
        ("mean fibre length", run.fibre_lengths),
    ):
        if name in lengths:
            mean = lengths[name].mean(axis=1)
            facts.append((title, f"{number(mean.min())} to {number(mean.max())} mm", None))
    for coordinate, arms in run.all_arms.get(name, {}).items():
        chosen = np.unique([0, len(arms.values) // 2, len(arms.values) - 1])
        means, values = (" / ".join(number(column[i]) for i in chosen) for column in (arms.mean, arms.values))
        error = muscle["moment_arms"][coordinate]["errors"]["total_mm"]
        unit = "mm" if arms.unit in ANGLES else ""
        words = f"{means} {unit} at {values} {arms.unit}, error {number(error, 2)} {unit}"
        facts.append((f"moment arm, {label_of(coordinate)}", words, [name, coordinate]))
    architecture = muscle.get("architecture") or {}
    if "tendon_from" in architecture:
        area = number(architecture["pcsa_without_tendon_mm2"] / 100.0)
        facts.append((f"PCSA, {RESTS_ON[architecture['tendon_from']]}", f"{area} cm²", None))
    if muscle.get("volume_mm3"):
        facts.append(("volume", f"{number(muscle['volume_mm3'] / 1000.0)} cm³", None))
    reasons = muscle["verdict"]["reasons"]
    finished = run.finished(name)
    if finished < len(run.frames):
        facts.append(("frames", f"{finished} of {len(run.frames)}", None))
    return {
        "name": name,
        "label": label_of(name),
        "colour": colour_of(position),
        "verdict": run.verdicts[name],
        "facts": facts,
        "reasons": [{"says": _sentence(reason["says"]), "frame": reason["frame"]} for reason in reasons],
        "remedies": list(dict.fromkeys(_sentence(reason["do"]) for reason in reasons)),
    }


def _sentence(words: Any) -> str:
    text = str(words)
    return f"{text[:1].upper()}{text[1:]}."
