"""A run's report as one page that needs nothing else: the scene, curves, tables, and what to make of them."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.motion.coordinates import ANGLES
from vtkmuscle.io.writing import write_text
from vtkmuscle.report.curves import colour_of, curves_of, label_of
from vtkmuscle.report.scene3d import Pack, scene_of
from vtkmuscle.report.sections import part, rendered
from vtkmuscle.report.tables import errors_of, number, run_tables_of, settings_of, tables_of

if TYPE_CHECKING:
    from vtkmuscle.run.limits import Check
    from vtkmuscle.run.result import Result

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


def write_page(path: str | PathLike[str], result: Result, limits: Mapping[str, Check]) -> Path:
    """Write the page of a run to an .html file that loads nothing from anywhere, and return the file.

    ``limits`` are those of each check of the verdicts; they are drawn beside the curves.
    """
    write_text(Path(path), page_of(result, limits))
    return Path(path)


def page_of(result: Result, limits: Mapping[str, Check]) -> str:
    """Return the page of a run as text, see :func:`write_page`."""
    report = result.report
    arms = result.moment_arms() if result.has_moment_arms else {}
    pack = Pack()
    scene = scene_of(result, pack)
    curves = curves_of(result, arms, limits, pack)
    muscles = [_card(result, k, name, arms.get(name, {})) for k, name in enumerate(result.muscle_names)]
    return rendered(
        "report.html",
        name=result.name,
        script=Markup("\n").join(map(part, _SCRIPTS)),
        lead=_lead(result),
        summary=_summary(result),
        stopped=report.get("stopped_by") if not report["complete"] else None,
        warnings=report.get("sense", ()),
        badge=BADGES,
        compact=len(muscles) > MANY,
        muscles=muscles,
        thinned=_thinned(scene),
        alt=f"The scene in three dimensions: {', '.join(one['label'] for one in muscles)}, "
        f"and the bones {', '.join(bone['name'] for bone in scene['bones'])}.",
        surfaces=report["deformer"] != "none",
        fibres=bool(result.fibre_lengths),
        curves=bool(result.lengths or result.fibre_lengths or curves["checks"]),
        lengths=bool(result.lengths),
        fibre_lengths=bool(result.fibre_lengths),
        arms=bool(arms),
        checks=curves["checks"],
        coordinates=curves["coordinates"],
        time_label=result.time_label,
        last=len(scene["shown"]) - 1,
        tables=tables_of(report),
        trust={"words": TRUST, "tables": errors_of(report)},
        run_tables=run_tables_of(report),
        settings=settings_of(report),
        definitions=list(report["definitions"].items()),
        data={"scene": scene, "curves": curves, "frames": list(result.frames)},
        arrays=Markup(pack.text()),
    )


def _lead(result: Result) -> str:
    count, frames = len(result.muscle_names), len(result.frames)
    name, _, unit = result.time_label.partition(" [")
    unit = unit.removesuffix("]")
    over = f"{name} {number(result.times[0])} to {number(result.times[-1])} {unit}".strip()
    paths = result.report["deformer"] == "none"
    model = "Fibres as taut paths round the bones, no volumes" if paths else "Muscles as volumes"
    return f"{count} muscle{'s' * (count > 1)}, {frames} frame{'s' * (frames > 1)}, {over}. {model}."


def _summary(result: Result) -> str:
    """Return in plain words which muscles can be used."""
    groups = {
        verdict: [label_of(name) for name in result.muscle_names if result.verdicts[name] == verdict]
        for verdict in BADGES
    }
    words = []
    if len(groups["ok"]) == len(result.muscle_names):
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


def _card(result: Result, place: int, name: str, arms: Mapping[str, JointArms]) -> dict[str, Any]:
    muscle = result.report["muscles"][name]
    facts: list[tuple[str, str, list[str] | None]] = []
    known = {"mean length, bone to bone": result.lengths, "mean fibre length": result.fibre_lengths}
    for title, lengths in known.items():
        if len(lengths.get(name, ())):
            mean = lengths[name].mean(axis=1)
            facts.append((title, f"{number(mean.min())} to {number(mean.max())} mm", None))
    for coordinate, found in arms.items():
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
    finished = result.finished(name)
    if finished < len(result.frames):
        facts.append(("frames", f"{finished} of {len(result.frames)}", None))
    return {
        "name": name,
        "label": label_of(name),
        "colour": colour_of(place),
        "verdict": result.verdicts[name],
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
