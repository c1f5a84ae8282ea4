"""Attachments between bones that a scene names, and how sure they are."""

import tomllib

import pytest
import tomli_w

from vtkmuscle import Scene, SceneError
from vtkmuscle.phantoms import spindle_over_hinge


def with_attachments(tmp_path, value):
    """Write the scene of a spindle between the bones proximal and distal; return its file."""
    path = Scene.from_phantom(spindle_over_hinge(), n_fibres=4, resolution=5).save(tmp_path / "scene")
    tables = tomllib.loads(path.read_text())
    tables["muscles"]["spindle"]["attachments"] = value
    path.write_text(tomli_w.dumps(tables))
    return path


def test_the_bones_may_be_named_origin_first(tmp_path):
    scene = Scene.load(with_attachments(tmp_path, {"estimate": ["distal", "proximal"]}))
    areas = scene.muscles["spindle"].attachments
    assert [(area.role, area.bone) for area in areas] == [("origin", "distal"), ("insertion", "proximal")]
    again = Scene.load(scene.save(tmp_path / "again")).muscles["spindle"].attachments
    assert all(area.estimated for area in again)
    assert [area.role for area in again] == ["origin", "insertion"]


def test_how_sure_an_estimate_is_comes_with_the_report(tmp_path):
    scene = Scene.load(with_attachments(tmp_path, "estimate"))
    report = scene.run(frames="0:2", figures=False).report["muscles"]["spindle"]
    assert report["estimated_attachments"] == 2
    assert 0.51 < report["attachment_confidence"] <= 0.64


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ({"estimate": ["proximal"]}, "must name two bones"),
        ({"guess": ["proximal", "distal"]}, "must name two bones"),
        ({"estimate": ["proximal", "elbow"]}, "there is no bone 'elbow'"),
        ({"estimate": ["proximal", "proximal"]}, "both 'proximal'"),
    ],
)
def test_other_than_two_bones_is_refused(tmp_path, value, words):
    with pytest.raises(SceneError, match=words) as caught:
        Scene.load(with_attachments(tmp_path, value))
    assert caught.value.key == "muscles.spindle.attachments"
