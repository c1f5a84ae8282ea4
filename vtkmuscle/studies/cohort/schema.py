"""The tables of a STUDY.toml, as pydantic models."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from vtkmuscle.scene.schema_types import Name, Table, Text

_Amount = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


def _key(default: Any, example: Any, description: str) -> Any:
    """Return what is said of a key; ``...`` is the default of one that must be there."""
    return Field(default, examples=[example], description=description)


class Sensitivity(Table):
    """What is moved about, one cause at a time, to see what the results owe to it."""

    samples: Annotated[int, Field(ge=3, le=10_000)] = _key(8, 20, "Runs for each cause, 3 or more.")
    seed: Annotated[int, Field(ge=0)] = _key(0, 1, "The same again for the same seed.")
    landmarks: _Amount = _key(
        0.0, 5.0, "Each area is moved as a whole by this distance [mm], in any direction."
    )
    axis: _Amount = _key(0.0, 3.0, "The motion's axes are tilted by this angle [degrees], all alike.")
    centre: _Amount = _key(0.0, 3.0, "The motion's axes are shifted by this distance [mm], all alike.")
    segmentation: _Amount = _key(0.0, 1.0, "Standard deviation of smooth waves of all surfaces [mm].")


class StudyTable(Table):
    """A study for vtkmuscle: subjects by a table, a template scene, motions."""

    name: Name | None = _key(None, "hips", "Name of the study. Without it that of the file.")
    subjects: Text = _key(
        ...,
        "subjects.csv",
        "A CSV table with a row per subject and a column id; all its columns are variables. A column folder "
        "is taken relative to the table's own folder.",
    )
    scene: Text = _key(
        ...,
        "template.toml",
        "A scene.toml in which {COLUMN} stands for the text in that column of the subject's row, and a value "
        "'{COLUMN:number}' for a number. A value that is '{COLUMN}' alone is left out where the cell is "
        "empty. Or '{folder}/scene.toml', a scene for each subject.",
    )
    frames: Text | None = _key(None, "0:31", "Frames to keep, as of vtkmuscle run. Without it all.")
    muscles: Annotated[list[Text], Field(min_length=1)] | None = _key(
        None, ["iliacus"], "Which muscles; without it all of the scene."
    )
    groups: Annotated[int, Field(ge=1, le=1000)] = _key(
        1, 3, "Groups of fibres that lengthen alike, a row each; 1 for their mean."
    )
    motions: dict[Name, dict[str, Any]] = _key(
        {}, {}, "Tables [motions.NAME], each a [motion] of a scene, in place of the template's."
    )
    settings: dict[Name, dict[str, Any]] = _key(
        {}, {}, "Tables [settings.NAME] of keys of a scene, laid over it: every subject is run with each."
    )
    sensitivity: Sensitivity | None = _key(None, {}, "Runs every subject again with inputs moved about.")
