import json

import numpy as np
import pytest

from vtkmuscle.core.template.kinds import TEMPLATES, read_template, template_from
from vtkmuscle.data.arrays import field_array, points_of
from vtkmuscle.filters.fibre_template_source import FibreTemplateSource

STRAP = """
sheets = [
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
    [[0.3, 0, 0.5], [1, 0, 0.5], [1, 1, 0.5], [0.3, 1, 0.5]],
    [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
]
"""


@pytest.mark.parametrize("kind", list(TEMPLATES))
@pytest.mark.parametrize("suffix", ["json", "toml"])
def test_every_kind_can_be_written_to_a_file_and_read_again(kind, suffix, tmp_path):
    parts = [sheets.tolist() for sheets in TEMPLATES[kind].parts]
    file = tmp_path / f"own.{suffix}"
    if suffix == "json":
        file.write_text(json.dumps({"parts": [{"sheets": sheets} for sheets in parts]}))
    else:
        file.write_text("".join(f"[[parts]]\nsheets = {sheets}\n" for sheets in parts))
    here, there = (
        FibreTemplateSource(n_fibres=20, **source).update().output
        for source in ({"template": kind}, {"template_file": str(file)})
    )
    assert np.array_equal(points_of(here), points_of(there))
    for area in ("OriginArea", "InsertionArea"):
        assert np.array_equal(field_array(here, area), field_array(there, area))


def test_a_file_of_one_part_needs_no_parts(tmp_path):
    file = tmp_path / "strap.toml"
    file.write_text(STRAP)
    template = read_template(file)
    assert np.array_equal(template.fibres([0.0], [0.5], [0.0, 0.5, 1.0])[0, 1], [0.15, 0.5, 0.5])


def strap(**changes):
    sheets = [[[0, 0, z], [1, 0, z], [1, 1, z], [0, 1, z]] for z in (0, 0.5, 1)]
    for place, value in changes.items():
        *path, last = (int(i) for i in place[1:].split("_"))
        target = sheets
        for i in path:
            target = target[i]
        target[last] = value
    return {"sheets": sheets}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ([], "there must be the key 'sheets', or the key 'parts'"),
        ({"parts": []}, "the key 'parts' with a list of tables"),
        ({"sheet": []}, "must be a table with the single key 'sheets'"),
        ({"sheets": 3}, "sheets must be a list of 3 to 5 sheets"),
        ({"sheets": strap()["sheets"][:2]}, "must be a list of 3 to 5"),
        (strap(_1_2=[0, 1]), "each of 4 corners with three numbers"),
        (strap(_1_2=[0, 1, 1.2]), "must be points of the unit cube"),
        (strap(_1_2=[0, 1, float("nan")]), "must be points of the unit cube"),
        (strap(_0=[[0, 0, 0]] * 4), "the corners of the origin area enclose no area"),
        (strap(_2=strap()["sheets"][0]), "the origin area and the insertion area are the same"),
        ({"parts": [strap(), {}]}, r"parts\[1\] must be a table with the single key 'sheets'"),
        ({"parts": [strap(), {"sheets": strap()["sheets"][:1] * 3 + strap()["sheets"][2:]}]}, "same number"),
    ],
)
def test_errors_say_where_and_what_is_allowed(content, message):
    with pytest.raises(ValueError, match=f"own: .*{message}|own: {message}"):
        template_from(content, "own")


def test_files_that_are_none_are_errors_of_the_source(tmp_path):
    with pytest.raises(ValueError, match=r"Source: template_file: .*missing.toml cannot be read"):
        FibreTemplateSource(template_file=str(tmp_path / "missing.toml")).update()
    for name, message in (("own.yaml", "must be a .toml or a .json"), ("own.json", "is not JSON")):
        (tmp_path / name).write_text(STRAP)
        with pytest.raises(ValueError, match=message):
            FibreTemplateSource(template_file=str(tmp_path / name)).update()
