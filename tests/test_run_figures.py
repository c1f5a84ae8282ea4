"""The figures of a run: drawn by a process of its own, as this one would, and whatever happens to that."""

import json
import shutil

import matplotlib
import numpy as np
import pytest
from PIL import Image
from tiny_scene import write_tiny_scene

from vtkmuscle import Scene
from vtkmuscle.data import drawn_bones
from vtkmuscle.plotting import can_render, drawing
from vtkmuscle.plotting.drawing import FigureOrder
from vtkmuscle.run import figures as run_figures
from vtkmuscle.run.figures import Drawing


@pytest.fixture
def scene(tmp_path_factory):
    return Scene.load(write_tiny_scene(tmp_path_factory.mktemp("scene")))


@pytest.fixture
def renders():
    reason = can_render()
    if reason is not None:
        pytest.skip(reason)


def test_without_opengl_all_but_the_figures_is_written(scene, tmp_path, monkeypatch):
    script = "import os, sys; print('no libOSMesa', file=sys.stderr, flush=True); os.abort()"
    monkeypatch.setattr(drawing, "TEST_PICTURE", script)
    with pytest.warns(UserWarning, match="no figures were drawn, all else was written: .* crashed"):
        result = scene.run(tmp_path, frames="0:2")
    assert result.report["figures"]["written"] == []
    assert result.report["figures"]["reason"].endswith("no libOSMesa")
    assert not (tmp_path / "figures").exists()
    assert (tmp_path / "report.html").stat().st_size > 1_000_000
    assert json.loads((tmp_path / "report.json").read_text())["complete"] is True
    assert not list(tmp_path.glob(".*"))


def test_a_process_that_hangs_before_it_can_draw_is_given_up(scene, tmp_path, monkeypatch):
    monkeypatch.setattr(drawing, "TEST_PICTURE", "import time; time.sleep(600)")
    monkeypatch.setattr(drawing, "PREFLIGHT_TIMEOUT", 0.5)
    with pytest.warns(UserWarning, match="a test picture was not finished within"):
        result = scene.run(tmp_path, frames=0, report=False)
    assert result.report["figures"]["written"] == []


def test_a_package_that_cannot_be_loaded_is_named(renders, scene, tmp_path, monkeypatch):
    planted = f"{drawing.TEST_PICTURE}\nsys.modules['matplotlib'] = None"
    monkeypatch.setattr(drawing, "TEST_PICTURE", planted)
    with pytest.warns(UserWarning, match=r"ended with status 1; .*import of matplotlib halted"):
        scene.run(tmp_path, frames=0, report=False)


def test_figures_are_moved_into_place(renders, scene, tmp_path):
    scene.run(tmp_path, frames=0)
    (tmp_path / "figures/mine.png").write_bytes(b"")
    result = scene.run(tmp_path, frames=0, fresh=True)
    of_spindle = [f"spindle_{name}.png" for name in ("fibre_lengths", "frames", "lengths")]
    names = ["rest_pose.png", *of_spindle]
    assert result.report["figures"] == {"written": names}
    assert sorted(p.name for p in (tmp_path / "figures").iterdir()) == ["mine.png", *names]
    assert result.report["seconds"]["figures"] > 0.0
    assert not list(tmp_path.glob(".*"))


def test_figures_of_muscles_that_are_taken_over_are_drawn(renders, scene, tmp_path):
    first = scene.run(tmp_path, frames=0).report["figures"]
    shutil.rmtree(tmp_path / "figures")
    again = scene.run(tmp_path, frames=0)
    assert again.report["taken_over"] == ["spindle"]
    assert again.report["figures"] == first
    assert {p.name for p in (tmp_path / "figures").iterdir()} == set(first["written"])


def test_figures_that_another_process_draws_are_those_that_this_one_draws(renders, scene, tmp_path):
    result = scene.run(tmp_path / "out", frames="0:3")
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        written = result.write_figures(tmp_path / "again")
    assert sorted(path.name for path in written) == result.report["figures"]["written"]
    for path in written:
        there, here = (np.asarray(Image.open(one)) for one in (tmp_path / "out/figures" / path.name, path))
        np.testing.assert_array_equal(there, here, err_msg=path.name)


def test_the_process_that_draws_makes_the_bones_coarser_for_the_page_too(
    renders, scene, tmp_path, monkeypatch
):
    def never(*_):
        raise AssertionError("made twice")

    monkeypatch.setattr(drawn_bones, "mean_normals", never)
    scene.run(tmp_path, frames=0)
    assert (tmp_path / "report.html").is_file()


def test_a_picture_that_cannot_be_drawn_loses_no_muscle(renders, scene, tmp_path, monkeypatch):
    begin = Drawing.__init__

    def without_a_folder(self, results, scene):
        begin(self, results, scene)
        self._beside.write_bytes(b"in the way")

    monkeypatch.setattr(Drawing, "__init__", without_a_folder)
    with pytest.raises(OSError, match=f"{tmp_path.name}/figures"):
        scene.run(tmp_path, frames="0:3")
    report = json.loads((tmp_path / "report.json").read_text())
    assert len(report["muscles"]["spindle"]["frames"]) == 3
    assert not report["complete"]
    assert "FileExistsError" in report["stopped_by"]


def test_an_error_in_drawing_is_told_with_where_it_was_raised(renders, scene, tmp_path, monkeypatch):
    def upside_down(result, name):
        return [FigureOrder("upside_down", "plot_lengths", {"times": [1.0], "lengths": "none"})]

    monkeypatch.setattr(run_figures, "figures_of_muscle", upside_down)
    with pytest.raises(ValueError, match="could not convert") as raised:
        scene.run(tmp_path, frames=0)
    assert "in plot_lengths" in raised.value.__notes__[0]
    assert json.loads((tmp_path / "report.json").read_text())["complete"] is False
    assert not list(tmp_path.glob(".*"))


def test_a_crash_of_what_draws_takes_no_run_with_it(renders, scene, tmp_path, monkeypatch):
    """The figures that were drawn before are kept, and the reason is said."""

    def deadly(result, name):
        times = {"times": [0.0, 1.0], "lengths": [[1.0], [2.0]]}
        return [FigureOrder("before", "plot_lengths", times), FigureOrder("crash", "_crash", {})]

    monkeypatch.setattr(run_figures, "figures_of_muscle", deadly)
    planted = "import os\nimport vtkmuscle.plotting\nvtkmuscle.plotting._crash = os.abort"
    monkeypatch.setattr(drawing, "TEST_PICTURE", f"{drawing.TEST_PICTURE}\n{planted}")
    with pytest.warns(UserWarning, match="not all figures were drawn, all else was written: .*SIGABRT"):
        result = scene.run(tmp_path, frames=0)
    assert "before.png" in result.report["figures"]["written"]
    assert {p.name for p in (tmp_path / "figures").iterdir()} == set(result.report["figures"]["written"])
    assert "SIGABRT" in result.report["figures"]["reason"]
    assert json.loads((tmp_path / "report.json").read_text())["complete"] is True
    assert not list(tmp_path.glob(".*"))


def test_a_run_that_fails_leaves_no_process_that_draws(renders, scene, tmp_path, monkeypatch):
    begun = []
    begin = drawing.DrawingProcess.__init__

    def noted(self, bones):
        begin(self, bones)
        begun.append(self._process._process)

    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(drawing.DrawingProcess, "__init__", noted)
    with pytest.raises(KeyboardInterrupt):
        scene.run(tmp_path, frames="0:3", observe=stop)
    (process,) = begun
    assert process.returncode is not None
    assert not list(tmp_path.glob(".*"))
