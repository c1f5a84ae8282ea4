"""One output alone: the numbers of a whole run, by a shorter chain, and no other file."""

from dataclasses import replace
from itertools import count

import pytest
from numpy.testing import assert_allclose

from vtkmuscle import Scene, phantoms
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.paths.sheet import PathState
from vtkmuscle.data.arrays import add_arrays, points_of
from vtkmuscle.filters import FibreMetrics, PathDeformer, TautPaths
from vtkmuscle.run import ONLY, run_only
from vtkmuscle.run.table import Table

EXECUTE = TautPaths.execute


@pytest.fixture(scope="module")
def scene():
    return Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8)


@pytest.fixture(scope="module")
def whole(scene):
    return scene.run(frames="0:9:4", figures=False)


def test_lengths_and_moment_arms_are_those_of_a_run(scene, whole, tmp_path):
    lengths = run_only(replace(scene, deformer="pbd"), "lengths", tmp_path, frames="0:9:4")
    arms = run_only(scene, "moment_arms", tmp_path, frames="0:9:4")
    assert isinstance(lengths, Table)
    assert_allclose(lengths["length_mm"], whole.length_table()["length_mm"], rtol=0, atol=1e-9)
    expected = whole.moment_arms().table()
    assert_allclose(arms["moment_arm_mm"], expected["moment_arm_mm"], rtol=0, atol=1e-9)
    assert set(arms["frame"]) == {0, 4, 8}
    names = {".vtkmuscle.json", "lengths.csv", "moment_arms.csv", "poses.csv"}
    assert {path.name for path in tmp_path.iterdir()} == names


def test_paths_that_are_not_ok_are_warned_of(scene, monkeypatch):
    shaky = count()

    def execute(self, *inputs):
        frame = EXECUTE(self, *inputs)
        return add_arrays(frame, fields={"Passed": 0.5, "Unsettled": int(next(shaky) == 0)})

    monkeypatch.setattr(TautPaths, "execute", execute)
    with pytest.warns(UserWarning, match="muscles.spindle") as warned:
        run_only(scene, "lengths", frames="0:9:4")
    passed, unsettled = (str(each.message) for each in warned)
    assert "muscles.spindle: failed, frame 0 (time 0): 50 % of the paths have passed" in passed
    assert "do not come to rest in 33 % of the frames" in unsettled


def test_surfaces_are_those_of_a_run(scene, whole, tmp_path):
    surfaces = run_only(scene, "surfaces", tmp_path, frames="0:9:4")["spindle"]
    for frame, surface in zip(whole.frames, surfaces, strict=True):
        assert_allclose(points_of(surface), points_of(whole.muscle("spindle", frame=frame)), atol=1e-9)
    assert sorted(path.name for path in tmp_path.iterdir()) == [".vtkmuscle.json", "spindle", "spindle.pvd"]
    (tmp_path / "spindle/spindle_0008.vtp").write_text("mine")
    run_only(scene, "surfaces", tmp_path, frames="0")  # frames of the earlier command go, the user's stay
    assert {path.name for path in tmp_path.glob("*/*")} == {"spindle_0000.vtp", "spindle_0008.vtp"}


@pytest.mark.parametrize("what", ["lengths", "moment_arms"])
def test_only_what_is_needed_is_computed(scene, what, monkeypatch):
    def fail(*_):
        raise AssertionError("computed, though nobody asked")

    monkeypatch.setattr(PathDeformer, "execute", fail)
    monkeypatch.setattr(FibreMetrics, "execute", fail)
    if what == "lengths":
        monkeypatch.setattr(PathState, "levers", fail)
    run_only(scene, what, frames="0:2")


def test_a_run_replaces_a_single_output_and_is_not_replaced_by_a_single_output(scene, tmp_path):
    run_only(scene, "lengths", tmp_path, frames="0:1")
    scene.run(tmp_path, frames="0:1", figures=False)
    with pytest.raises(InputError, match="the folder has the results of a run"):
        run_only(scene, "moment_arms", tmp_path, frames="0:1")


def test_a_table_of_other_muscles_is_not_replaced(scene, tmp_path):
    """The moment arms of the first muscle were lost in silence."""
    two = replace(scene, muscles=dict.fromkeys(("first", "second"), scene.muscles["spindle"]))
    run_only(two.with_muscles("first"), "moment_arms", tmp_path, frames="0:2")
    with pytest.raises(InputError, match=r"arms.csv: the run would remove the finished results of first;"):
        run_only(two.with_muscles(["second"]), "moment_arms", tmp_path, frames="0:2")
    assert set(run_only(two, "moment_arms", tmp_path, frames="0:2")["muscle"]) == {"first", "second"}


@pytest.mark.parametrize("what", ONLY)
def test_a_file_of_the_users_is_not_replaced(scene, what, tmp_path):
    file = tmp_path / ("spindle.pvd" if what == "surfaces" else f"{what}.csv")
    file.write_text("mine")
    with pytest.raises(InputError, match="the file exists"):
        run_only(scene, what, tmp_path, frames="0:1")
    assert file.read_text() == "mine"
    run_only(scene, what, tmp_path, frames="0:1", overwrite=True)
    assert file.read_text() != "mine"


@pytest.mark.parametrize("what", [*ONLY, "volumes"])
def test_another_word_and_mistakes_of_the_scene_are_refused(scene, what):
    words = "units: " if what in ONLY else r"only is .volumes., but must be one of"
    with pytest.raises(InputError, match=words):
        run_only(replace(scene, units="m"), what, frames="0:1")
