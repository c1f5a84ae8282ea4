"""A run's report as one page that needs nothing else: the scene, curves, tables, and what to make of them."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from vtkmuscle.core.motion.coordinates import ANGLES
from vtkmuscle.io.writing import write_text
from vtkmuscle.report.contents import RunContent
from vtkmuscle.report.curves import colour_of, curves_of, label_of
from vtkmuscle.report.scene3d import Pack, scene_of
from vtkmuscle.report.sections import part, rendered
from vtkmuscle.report.tables import errors_of, number, run_tables_of, settings_of, tables_of

#: Of more muscles than this the cards show a line, and the rest when it is asked for.
MANY = 6
#: Verdicts in words.
BADGES = {"ok": "✓ ok", "look": "! look at it", "failed": "✗ failed"}
#: What a muscle's cross-section rests on, in words.
RESTS_ON = {
    "aponeuroses": "fibres between aponeuroses",
    "scene": "fibres bone to bone, less the scene's tendon",
    "estimate": "fibres bone to bone, less an estimated tendon",
}
#: What the page's numbers can be trusted for.
TRUST = (
    "The checks say whether a shape is sound: whether it keeps its volume, does not crumple, stays out "
    "of the bones and follows its attachments. They do not say whether it is the shape of this person's "
    "muscle: that depends on the segmentation, the attachments and the motion that were given.",
    "Lengths and moment arms are those of the muscle's paths, from bone to bone; a moment arm is the "
    "lever of a path's pull. Strain, pennation and cross-sectional area are those of its fibres.",
)
#: The parts of the page's program, in the order in which they are read.
_SCRIPTS = (
    *("arrays.js", "webgl.js", "shaders.js", "colours.js", "shapes.js", "camera.js", "viewer.js"),
    *("saving.js", "charts.js", "curves.js", "page.js"),
)


def write_page(path: str | PathLike[str], run: RunContent) -> Path:
    """Write the page of a run to an .html file that loads nothing from anywhere, and return the file."""
    write_text(Path(path), page_of(run))
    return Path(path)


def page_of(run: RunContent) -> str:
    """Return the page of a run as text, see :func:`write_page`."""
    report, pack = run.report, Pack()
    scene = scene_of(run, pack)
    curves = curves_of(run, pack)
    muscles = [_card(run, number, name) for number, name in enumerate(run.muscles)]
    lengths = any(muscle.lengths is not None for muscle in run.muscles.values())
    fibre_lengths = any(muscle.fibre_lengths is not None for muscle in run.muscles.values())
    return rendered(
        "report.html",
        name=report["scene"],
        script=Markup("\n").join(map(part, _SCRIPTS)),
        lead=_lead(run),
        summary=_summary(run),
        stopped=report.get("stopped_by") if not report["complete"] else None,
        warnings=report.get("sense", ()),
        badge=BADGES,
        compact=len(muscles) > MANY,
        muscles=muscles,
        thinned=_thinned(scene),
        alt=f"The scene in three dimensions: {', '.join(one['label'] for one in muscles)}, "
        f"and the bones {', '.join(bone['name'] for bone in scene['bones'])}.",
        surfaces=report["deformer"] != "none",
        fibres=fibre_lengths,
        curves=bool(lengths or fibre_lengths or curves["checks"]),
        lengths=lengths,
        fibre_lengths=fibre_lengths,
        arms=any(muscle.arms for muscle in run.muscles.values()),
        checks=curves["checks"],
        coordinates=curves["coordinates"],
        time_label=run.time_label,
        last=len(scene["shown"]) - 1,
        tables=tables_of(report),
        trust={"words": TRUST, "tables": errors_of(report)},
        run_tables=run_tables_of(report),
        settings=settings_of(report),
        definitions=list(report["definitions"].items()),
        data={"scene": scene, "curves": curves, "frames": list(run.frames)},
        arrays=Markup(pack.text()),
    )


def _lead(run: RunContent) -> str:
    count, frames = len(run.muscles), len(run.frames)
    name, _, unit = run.time_label.partition(" [")
    unit = unit.removesuffix("]")
    over = f"{name} {number(run.times[0])} to {number(run.times[-1])} {unit}".strip()
    paths = run.report["deformer"] == "none"
    model = "Fibres as taut paths round the bones, no volumes" if paths else "Muscles as volumes"
    return f"{count} muscle{'s' * (count > 1)}, {frames} frame{'s' * (frames > 1)}, {over}. {model}."


def _summary(run: RunContent) -> str:
    """Return in plain words which muscles can be used."""
    groups = {
        verdict: [label_of(name) for name in run.muscles if run.verdict(name) == verdict]
        for verdict in BADGES
    }
    words = []
    if len(groups["ok"]) == len(run.muscles):
        words.append("All checks passed." if len(groups["ok"]) > 1 else "It passed all checks.")
    elif groups["ok"]:
        words.append(f"Passed all checks: {_listed(groups['ok'])}.")
    if groups["look"]:
        words.append(f"Use with care, and look at what is named below first: {_listed(groups['look'])}.")
    if groups["failed"]:
        words.append(f"Do not use: {_listed(groups['failed'])}.")
    return " ".join(words)


def _listed(names: list[str]) -> str:
    return ", ".join(names[:-1]) + (" and " if len(names) > 1 else "") + names[-1]


def _card(run: RunContent, position: int, name: str) -> dict[str, Any]:
    muscle, content = run.report["muscles"][name], run.muscles[name]
    facts: list[tuple[str, str, list[str] | None]] = []
    by_title = {
        "mean length, bone to bone": content.lengths,
        "mean fibre length": content.fibre_lengths,
    }
    for title, lengths in by_title.items():
        if lengths is not None:
            mean = lengths.mean(axis=1)
            facts.append((title, f"{number(mean.min())} to {number(mean.max())} mm", None))
    for coordinate, found in content.arms.items():
        some = np.unique([0, len(found.values) // 2, len(found.values) - 1])
        means = " / ".join(number(found.mean[i]) for i in some)
        values = " / ".join(number(found.values[i]) for i in some)
        unit = "mm" if found.unit in ANGLES else ""
        words = f"{means} {unit} at {values} {found.unit}"
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
        "verdict": run.verdict(name),
        "facts": facts,
        "reasons": [{"says": _sentence(one["says"]), "frame": one["frame"]} for one in reasons],
        "remedies": list(dict.fromkeys(_sentence(one["do"]) for one in reasons)),
    }


def _sentence(words: Any) -> str:
    text = str(words)
    return f"{text[:1].upper()}{text[1:]}."


def _thinned(scene: Mapping[str, Any]) -> str:
    """Return a sentence for each kind of detail that the scene leaves out to stay small."""
    words = []
    drawn = [one for one in scene["muscles"] if one["surface"] is not None]
    if any(one["surface"]["points"]["points"] < one["surface"]["whole"] for one in drawn):
        words.append("Surfaces are drawn with fewer triangles than were computed.")
    fibres = [one["fibres"] for one in scene["muscles"] if one["fibres"] is not None]
    if any(one["count"] < one["all"] for one in fibres):
        words.append("Of many fibres some are drawn.")
    return " ".join(words)
