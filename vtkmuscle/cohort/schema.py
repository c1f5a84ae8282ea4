"""The tables of a STUDY.toml, as pydantic models.

``python -m vtkmuscle.cohort.schema`` prints the JSON schema for editors.
"""

from __future__ import annotations

import json
import sys
from typing import Annotated, Any

from pydantic import Field

from vtkmuscle.scene.schema_types import Name, Table, Text

_Positive = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


class Sensitivity(Table):
    """What is moved about, one cause at a time, to see what the results owe to it."""

    samples: Annotated[int, Field(ge=3, le=10_000)] = Field(
        8, examples=[20], description="Runs for each cause, 3 or more."
    )
    seed: Annotated[int, Field(ge=0)] = Field(
        0, examples=[1], description="The same again for the same seed."
    )
    landmarks: _Positive = Field(
        0.0,
        examples=[5.0],
        description="Each attachment area is moved as a whole by this distance [mm], each in a direction of "
        "its own.",
    )
    axis: _Positive = Field(
        0.0,
        examples=[3.0],
        description="The motion's axes are tilted by this angle [degrees], in any direction, all alike.",
    )
    centre: _Positive = Field(
        0.0, examples=[3.0], description="The motion's axes are shifted by this distance [mm], likewise."
    )
    segmentation: _Positive = Field(
        0.0,
        examples=[1.0],
        description="Standard deviation of a smooth displacement of all surfaces along their normals [mm].",
    )


class Compare(Table):
    """Two groups, or two settings, that are compared."""

    by: Text = Field(
        examples=["setting"],
        description="'setting' for two of [settings.NAME], paired by subject, or a column of the table of "
        "subjects with two different values.",
    )
    pair: Text | None = Field(
        None,
        examples=["person"],
        description="A column of the table of subjects that says which of the two groups belong together: "
        "both hips of a person. Without it groups are compared as independent ones.",
    )


class StudyTable(Table):
    """A study for vtkmuscle: subjects by a table, a template scene, motions."""

    name: Name | None = Field(
        None, examples=["hips"], description="Name of the study. Without it that of the file."
    )
    subjects: Text = Field(
        examples=["subjects.csv"],
        description="A CSV table with a row per subject and a column id; all its columns are variables. A "
        "column folder is taken relative to the table's own folder.",
    )
    scene: Text = Field(
        examples=["template.toml"],
        description="A scene.toml in which {COLUMN} stands for the text in that column of the subject's row, "
        "and a value '{COLUMN:number}' for a number. A value that is '{COLUMN}' alone is left out where the "
        "cell is empty. Or '{folder}/scene.toml', a scene for each subject.",
    )
    frames: Text | None = Field(
        None, examples=["0:31"], description="Frames to keep, as of vtkmuscle run. Without it all."
    )
    muscles: Annotated[list[Text], Field(min_length=1)] | None = Field(
        None, examples=[["iliacus"]], description="Which muscles; without it all of the scene."
    )
    groups: Annotated[int, Field(ge=1, le=1000)] = Field(
        1, examples=[3], description="Groups of fibres that lengthen alike, a row each; 1 for their mean."
    )
    pictures: bool = Field(
        True, examples=[False], description="Write true to draw every muscle at three poses for the report."
    )
    motions: dict[Name, dict[str, Any]] = Field(
        default_factory=dict,
        description="Tables [motions.NAME], each a [motion] of a scene, which take the place of the "
        "template's.",
    )
    settings: dict[Name, dict[str, Any]] = Field(
        default_factory=dict,
        description="Tables [settings.NAME] of keys of a scene, which are laid over the template: every "
        "subject is run with each.",
    )
    sensitivity: Sensitivity | None = Field(
        None, description="Runs every subject again with inputs moved about."
    )
    compare: Compare | None = Field(None, description="Compares two groups or settings.")


if __name__ == "__main__":
    sys.stdout.write(json.dumps(StudyTable.model_json_schema(), indent=1, ensure_ascii=False) + "\n")
