"""A study of few triangles on disk, for tests of cohorts."""

import re
from pathlib import Path

from tiny_scene import HINGE, write_tiny_scene

#: The subjects, and a column to group them by.
SUBJECTS = {"anna": "short", "ben": "long", "carl": "short"}


def write_tiny_study(folder: Path, *, more: str = "", subjects=SUBJECTS) -> Path:
    """Write a study of two muscles that share bones, over 6 frames; carl's spindle cannot be read."""
    for name in subjects:
        scene = write_tiny_scene(folder / name)
    text = scene.read_text()
    text = re.sub(r"\[motion\]\n(.|\n)*?\n\n", HINGE.lstrip() + "\n", text, count=1)
    text = text.replace("angles = [0, 20, 5]", 'angles = [0, "{stop:number}", 4]')
    text = re.sub(r'"((bones|muscles|attachments)/)', r'"{folder}/\1', text)
    start, end = text.index("[muscles.spindle]"), text.index("[solver]")
    other = (
        text[start:end].replace("muscles.spindle]", "muscles.other]").replace("n_fibres = 6", "n_fibres = 8")
    )
    (folder / "template.toml").write_text(text[:end] + other + text[end:])
    rows = [f"{name},{name},{group},20" for name, group in subjects.items()]
    (folder / "subjects.csv").write_text("id,folder,group,stop\n" + "\n".join(rows) + "\n")
    if "carl" in subjects:
        (folder / "carl/muscles/spindle.vtp").write_text("damaged")
    (folder / "study.toml").write_text(f'subjects = "subjects.csv"\nscene = "template.toml"\n{more}')
    return folder / "study.toml"
