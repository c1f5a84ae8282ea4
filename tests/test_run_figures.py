"""The figures of a run: drawn here or by other processes, and whatever happens to these."""

import copy
import json
import os
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
import pyvista as pv
from PIL import Image
from two_joint_scene import JOINTS, save_strap, scene_with

from vtkmuscle import Scene
from vtkmuscle.plotting import can_render, drawing
from vtkmuscle.plotting.drawing import FigureOrder
from vtkmuscle.plotting.sheets import SCREEN
from vtkmuscle.report.data import Pack, curves_of
from vtkmuscle.run import figures as run_figures
from vtkmuscle.run import result as run_result
from vtkmuscle.run import steps as run_steps


@pytest.fixture
def asked_anew():
    """Lets each test ask whether pictures can be rendered."""
    can_render.cache_clear()
    yield
    can_render.cache_clear()


def test_without_opengl_all_but_the_figures_is_written(asked_anew, scene, tmp_path, monkeypatch):
    script = "import os, sys; print('no libOSMesa', file=sys.stderr, flush=True); os.abort()"
    monkeypatch.setattr(drawing, "TEST_PICTURE", script)
    with pytest.warns(UserWarning, match="no figures were drawn; all further results were written.* crashed"):
        result = scene.run(tmp_path, frames="0:2")
    assert result.report["figures"]["written"] == []
    assert result.report["figures"]["reason"].endswith("no libOSMesa")
    assert not (tmp_path / "figures").exists()
    assert (tmp_path / "report.html").read_text(encoding="utf-8").endswith("</html>\n")
    assert json.loads((tmp_path / "report.json").read_text())["complete"] is True
    assert not list(tmp_path.glob(".*"))


def test_a_process_that_hangs_before_it_can_draw_is_given_up(asked_anew, scene, tmp_path, monkeypatch):
    monkeypatch.setattr(drawing, "TEST_PICTURE", "import time; time.sleep(600)")
    monkeypatch.setattr(drawing, "PREFLIGHT_TIMEOUT", 0.5)
    with pytest.warns(UserWarning, match="a test picture was not finished within"):
        result = scene.run(tmp_path, frames=0, report=False)
    assert result.report["figures"]["written"] == []


def test_figures_of_muscles_that_are_taken_over_are_drawn(renders, scene, tmp_path):
    first = scene.run(tmp_path, frames=0).report["figures"]
    shutil.rmtree(tmp_path / "figures")
    again = scene.run(tmp_path, frames=0)
    assert again.report["taken_over"] == ["spindle"]
    assert again.report["figures"] == first
    assert {p.name for p in (tmp_path / "figures").iterdir()} == set(first["written"])


def test_figures_are_written_in_each_form_or_not_at_all(renders, scene, tmp_path, monkeypatch):
    result, theme = scene.run(frames="0:2", figures=False), pv.global_theme.to_dict()
    for form in ("png", "pdf", "svg"):
        written = {path.stem: path for path in result.write_figures(tmp_path / form, form=form, dpi=75)}
        assert set(written.values()) == set((tmp_path / form).iterdir())
        assert set(written) == {
            "rest_pose",
            *(f"spindle_{n}" for n in ("fibre_lengths", "frames", "lengths")),
        }
        text = written["spindle_lengths"].read_bytes()
        assert form == "png" or b"<image" not in text
        assert b"/Subtype /Image" not in text
    assert b"path length [mm]" in text
    assert b"<image" in written["spindle_frames"].read_bytes()
    for path in (tmp_path / "png").iterdir():
        assert pv.read(path).point_data.active_scalars.std() > 5.0, f"{path.name} is blank"
    assert pv.read(tmp_path / "png/spindle_lengths.png").dimensions == (531, 315, 1)
    assert pv.global_theme.to_dict() == theme
    for options, words in (({"form": "jpg"}, "png, pdf, svg"), ({"dpi": 0}, "20 to 2400")):
        with pytest.raises(ValueError, match=words):
            result.write_figures(tmp_path, **options)
    monkeypatch.setattr(run_result, "can_render", lambda: "there is no display card")
    with pytest.raises(RuntimeError, match="there is no display card"):
        result.write_figures(tmp_path / "none")
    assert not (tmp_path / "none").exists()


def test_figures_have_a_column_of_a_journal_and_letters_to_be_read(renders, scene, tmp_path):
    result = scene.run(frames="0:2", figures=False)
    for width in (85, 180):
        for path in result.write_figures(tmp_path / f"{width}", form="svg", width=width):
            text = path.read_text()
            points = float(re.search(r'width="([\d.]+)pt"', text)[1])
            assert points == pytest.approx(width / 25.4 * 72.0, abs=0.5)
            assert min(float(size) for size in re.findall(r"font(?:-size)?: ([\d.]+)px", text)) >= 7.0


def test_several_coordinates_are_named_with_their_values(tmp_path):
    joints = copy.deepcopy(JOINTS)
    joints["hip"]["coordinates"] = ["hip_flexion_r"]
    save_strap(tmp_path / "strap")
    motion = {"grid": {"hip_flexion_r": [0, 20, 20], "lower": [0, 10, 10]}}
    file = scene_with(tmp_path / "strap", tmp_path, joints=joints, motion=motion, deformer="none")
    result = Scene.load(file).run(figures=False, sense=False)
    frames, lengths, *_ = run_figures.figures_of_muscle(result, "strap")
    assert frames.arguments["frames"][-1].label == "right hip flexion 20°, lower 0°"
    assert lengths.arguments["time_label"] == "right hip flexion [degrees]\nlower [degrees]"
    assert list(lengths.arguments["ticks"].values()) == ["0\n0", "0\n10", "20\n10", "20\n0"]
    curves = curves_of(result, Pack())
    assert curves["timeLabel"] == "pose"
    arms, axis = curves["muscles"][0]["arms"]["hip_flexion_r"], curves["coordinates"][0]
    assert arms["values"] == [axis["values"][int(at)] for at in arms["frames"]]
    assert sorted(set(arms["frames"])) == [0, 1, 2, 3], "the page shows the arm of each pose"


@pytest.fixture
def pair(scene):
    """A scene of two muscles, whose figures two processes draw."""
    return replace(scene, muscles=dict.fromkeys(("one", "other"), scene.muscles["spindle"]))


@pytest.mark.slow
def test_figures_that_another_process_draws_are_those_that_this_one_draws(renders, pair, tmp_path):
    result = pair.run(tmp_path / "out", frames="0:3", workers=2)
    written = result.write_figures(tmp_path / "again", dpi=SCREEN)
    assert sorted(path.name for path in written) == result.report["figures"]["written"]
    for path in written:
        there, here = (np.asarray(Image.open(one)) for one in (tmp_path / "out/figures" / path.name, path))
        np.testing.assert_array_equal(there, here, err_msg=path.name)


@pytest.mark.slow
def test_a_crash_of_a_process_that_draws_takes_no_run_with_it(renders, pair, tmp_path, monkeypatch):
    """The reason is said, and all else is written."""

    def deadly(result, name):
        return [FigureOrder(f"crash_{name}", "plot_lengths", {"a": Crash()})]

    monkeypatch.setattr(run_steps, "rest_pose_of", lambda _: deadly(None, "")[0])
    monkeypatch.setattr(run_steps, "figures_of_muscle", deadly)
    with pytest.warns(
        UserWarning, match="no figures were drawn; all further results were written: the drawing process"
    ):
        result = pair.run(tmp_path, frames=0, workers=2)
    assert result.report["figures"]["written"] == []
    assert json.loads((tmp_path / "report.json").read_text())["complete"] is True
    assert not list(tmp_path.glob(".*"))


class Crash:
    """Ends the process that reads it."""

    def __reduce__(self):
        return os.abort, ()
