"""Attachments between bones that a scene names, and how sure they are."""

import json

import pytest
from tiny_scene import TOML, write_tiny_scene

from vtkmuscle import Scene, SceneError


def with_attachments(tmp_path, value):
    path = write_tiny_scene(tmp_path / "scene")
    ((key, bones),) = value.items()
    start, end = TOML.index("attachments = ["), TOML.index("[solver]")
    text = path.read_text()
    assert TOML[start:end] in text
    path.write_text(text.replace(TOML[start:end], f"attachments = {{ {key} = {json.dumps(bones)} }}\n\n"))
    return path


def test_the_bones_may_be_named_origin_first(tmp_path):
    scene = Scene.load(with_attachments(tmp_path, {"estimate": ["lower", "upper"]}))
    assert [(area.role, area.bone) for area in scene.muscles["spindle"].attachments] == [
        ("origin", "lower"),
        ("insertion", "upper"),
    ]
    again = Scene.load(scene.save(tmp_path / "again"))
    assert all(area.estimated for area in again.muscles["spindle"].attachments)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ({"estimate": ["upper"]}, "must name two bones"),
        ({"guess": ["upper", "lower"]}, "must name two bones"),
        ({"estimate": ["upper", "elbow"]}, "there is no bone 'elbow'"),
        ({"estimate": ["upper", "upper"]}, "both 'upper'"),
    ],
)
def test_other_than_two_bones_is_refused(tmp_path, value, words):
    with pytest.raises(SceneError, match=words) as caught:
        Scene.load(with_attachments(tmp_path, value))
    assert caught.value.key == "muscles.spindle.attachments"
