"""Cohorts and varied settings: one table, on processes or Dask, with finished folders read again."""

from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from multiprocessing import active_children
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from commands import vtkmuscle_
from tiny_scene import write_tiny_scene
from two_joint_scene import save_strap, scene_with

import vtkmuscle
from vtkmuscle import Scene, phantoms
from vtkmuscle.cli import Status
from vtkmuscle.core.paths.poses import KeptPoses
from vtkmuscle.run.store import ResultFolder


@pytest.fixture(scope="module")
def scene():
    return Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=6, resolution=5)


@pytest.fixture
def solved(noted):
    """Return the names of the folders into which scenes are run from now on."""
    return noted(Scene, "run", lambda scene, out=None: None if out is None else Path(out).name)


def same_numbers(table, other, without=("seconds", "folder")):
    assert list(table) == list(other)
    for name in set(table) - set(without):
        np.testing.assert_array_equal(table[name], other[name], err_msg=name)


def test_a_row_has_the_numbers_of_a_run(scene):
    result = scene.run(frames="0:3")
    table = vtkmuscle.cohort({"anna": scene}, workers=1, frames="0:3")
    mean = result.lengths["spindle"].mean(axis=1)
    arms = result.moment_arms()["spindle"]["distal_angle"].mean
    expected = {"length_mm": mean.mean(), "length_least_mm": mean.min(), "length_largest_mm": mean.max()}
    expected |= {
        f"moment_arm_distal_angle{of}_mm": at for of, at in (("", arms.mean()), ("_largest", arms.max()))
    }
    expected |= {"fibre_length_mm": result.fibre_lengths["spindle"].mean(), "frames": 3}
    expected |= {"pcsa_mm2": result["spindle"].architecture["pcsa_mm2"]}
    np.testing.assert_allclose([table[name][0] for name in expected], list(expected.values()), rtol=1e-12)
    assert (table["subject"][0], table["muscle"][0], table["verdict"][0]) == ("anna", "spindle", "ok")


def test_frames_whose_paths_do_not_come_to_rest_have_no_part_in_means(scene, monkeypatch):
    def unsettled(poses, now, at=KeptPoses.at, **more):
        return replace(at(poses, now, **more), settled=bool(np.allclose(now, np.eye(4), atol=0.06)))

    monkeypatch.setattr(KeptPoses, "at", unsettled)
    table = vtkmuscle.cohort({"anna": scene}, workers=1, frames="0:4", deformer="none")
    assert table["length_mm"][0] == pytest.approx(scene.run(frames="0:2").lengths["spindle"].mean())


def test_a_finished_folder_is_read_and_a_changed_scene_is_run(scene, tmp_path, solved):
    first = vtkmuscle.cohort({"anna": scene, "ben": scene}, tmp_path, workers=1, frames="0:1")
    text = (tmp_path / "cohort.csv").read_text()
    assert sorted(solved) == sorted(first["folder"])
    solved.clear()
    same_numbers(vtkmuscle.cohort({"anna": scene, "ben": scene}, tmp_path, workers=1, frames="0:1"), first)
    assert solved == []
    assert (tmp_path / "cohort.csv").read_text() == text
    other = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=7, resolution=5)
    vtkmuscle.cohort({"anna": scene, "ben": other}, tmp_path, workers=1, frames="0:1", overwrite=True)
    assert solved == [first["folder"][1]]
    solved.clear()
    vtkmuscle.cohort({"anna": scene}, tmp_path, workers=1, frames="0:2")
    assert solved == [first["folder"][0]], "other frames are another run"


def test_a_missing_page_is_written_for_a_finished_subject(scene, tmp_path):
    first = vtkmuscle.cohort([scene], tmp_path, workers=1, frames="0:1")
    assert first["subject"].tolist() == [scene.name]
    again = vtkmuscle.cohort([scene], tmp_path, workers=1, frames="0:1", report=True)
    folder = tmp_path / again["folder"][0]
    assert (folder / "report.html").exists()
    same_numbers(again, first)
    (folder / "report.json").write_text((folder / "report.json").read_text() + " ")
    same_numbers(vtkmuscle.cohort([scene], tmp_path, workers=1, frames="0:1"), first)


@pytest.mark.slow
def test_warnings_of_processes_are_those_of_this_process(tmp_path):
    """A warning in a process was printed there with a line of the package, and not raised here."""
    text = write_tiny_scene(tmp_path / "odd").read_text()
    odd = [tmp_path / "odd" / f"{name}.toml" for name in "ab"]
    for file in odd:
        file.write_text(text.replace('units = "mm"', 'units = "cm"'))
    with pytest.warns(UserWarning, match="litres") as warned:
        vtkmuscle.cohort(odd, workers=2, frames="0:1")
    assert {str(one.message).split(": ")[0] for one in warned} == {str(file) for file in odd}


def test_a_scene_that_cannot_be_run_is_a_row(tmp_path, monkeypatch):
    good = write_tiny_scene(tmp_path / "good")
    bad = write_tiny_scene(tmp_path / "bad")
    (tmp_path / "bad/muscles/spindle.vtp").write_text("damaged")
    table = vtkmuscle.cohort([bad, good, tmp_path / "none.toml"], workers=1, frames="0:1")
    assert table["verdict"][[0, 2]].tolist() == ["failed", "failed"]
    assert table["verdict"][1] != "failed"
    assert "spindle.vtp" in table["message"][0]
    assert "none.toml" in table["message"][2]
    assert np.isnan(table["length_mm"][[0, 2]]).all()
    monkeypatch.setattr(Scene, "run", Mock(side_effect=RuntimeError("lost")))
    assert vtkmuscle.cohort([good, bad], workers=1)["message"][0] == "lost"


@pytest.mark.slow
def test_processes_give_the_same_table(scene, tmp_path):
    scenes, seen = {"anna": scene, "ben": scene}, []
    here = vtkmuscle.cohort(scenes, workers=1, frames="0:2")
    there = vtkmuscle.cohort(scenes, tmp_path, workers=2, frames="0:2", progress=seen.append)
    same_numbers(there, here)
    assert sorted(row["subject"] for rows in seen for row in rows) == ["anna", "ben"]


class Client:
    """What a cohort asks of Dask's client."""

    def __init__(self, executor):
        self.executor = executor

    def get_executor(self, *, pure):
        assert not pure
        return self.executor


class LostProcesses(ThreadPoolExecutor):
    def submit(self, *_):
        job = Future()
        job.set_exception(BrokenProcessPool("killed"))
        return job


def test_a_client_works_and_a_lost_process_is_a_row(scene):
    table = vtkmuscle.cohort(
        {"anna": scene, "ben": scene}, client=Client(ThreadPoolExecutor(1)), frames="0:1"
    )
    assert table["verdict"].tolist() == ["ok", "ok"]
    table = vtkmuscle.cohort({"anna": scene}, client=Client(LostProcesses()), frames="0:1")
    assert table["verdict"].tolist() == ["failed"]
    assert "run it again" in table["message"][0]


@pytest.mark.slow
def test_a_client_of_dask_gives_the_same_table(scene, tmp_path):
    distributed = pytest.importorskip("distributed", reason="the extra cohort is not installed")
    here = vtkmuscle.cohort({"anna": scene, "ben": scene}, workers=1, frames="0:2")
    address = {"dashboard_address": "127.0.0.1:0", "n_workers": 1, "threads_per_worker": 1}
    with distributed.Client(processes=False, **address) as client:
        there = vtkmuscle.cohort({"anna": scene, "ben": scene}, tmp_path, client=client, frames="0:2")
    same_numbers(there, here)


def test_settings_of_scene_and_fibres_are_varied(scene):
    table = vtkmuscle.vary(scene, workers=1, frames="0:1", deformer=["none", "paths"], n_fibres=4)
    assert table["deformer"].tolist() == ["none", "paths"]
    assert table["n_fibres"].tolist() == [4, 4]
    few = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=4, resolution=5)
    lengths = few.run(frames="0:1").lengths["spindle"]
    assert table.where(deformer="paths", n_fibres=4)["length_mm"] == pytest.approx(lengths.mean(), rel=1e-12)


def test_settings_of_the_paths_are_varied(scene):
    varied = {"n_paths": [4, 100], "paths.resolution": [8, 32]}
    table = vtkmuscle.vary(scene, workers=1, frames="0:2", deformer=["none"], **varied)
    assert table["n_paths"].tolist() == [4, 4, 100, 100]
    assert len(set(table["length_mm"])) == 4
    every = replace(scene, deformer="none").run(frames="0:2").lengths["spindle"]
    fine = table.where(n_paths=100, **{"paths.resolution": 32})["length_mm"]
    assert fine == pytest.approx(every.mean(), rel=1e-12)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda scene: vtkmuscle.cohort({}), "there are none"),
        (lambda scene: vtkmuscle.cohort(["a.toml", "a.toml"]), "two have the same name, 'a.toml'"),
        (lambda scene: vtkmuscle.cohort({"anna": scene}, workers=0), "workers is 0"),
        (lambda scene: scene.run(workers=2.5), r"workers is 2\.5, but must be an integer"),
        (lambda scene: vtkmuscle.compare({"a": "none", "b": "none"}), "none: there is no such folder"),
        (lambda scene: scene.run(progress=True), "progress is True, not a function"),
        (lambda scene: scene.run(figures="no"), "figures is 'no', but must be True or False"),
        (lambda scene: vtkmuscle.compare(scene.run(frames="0:1")), "no muscle is in two of the runs"),
        (vtkmuscle.vary, "no setting is varied"),
        (lambda scene: vtkmuscle.vary(scene, frames=99, n_fibres=3), "frames 99: the motion has"),
        (lambda scene: vtkmuscle.tradeoff(scene, frames=99), "frames 99: the motion has"),
        (lambda scene: vtkmuscle.vary(scene, workers=1, n_fibers=[3]), "n_fibers"),
        (lambda scene: vtkmuscle.vary(scene, workers=1, deformer=["path"]), "path"),
        (lambda scene: vtkmuscle.vary(scene, workers=1, n_paths=[3]), "n_paths: 3 is not allowed"),
    ],
)
def test_what_cannot_be_meant_is_refused(scene, call, words):
    with pytest.raises(ValueError, match=words):
        call(scene)


def test_the_command_writes_the_table_and_ends_with_the_status_of_the_worst(tmp_path):
    good, out = write_tiny_scene(tmp_path / "good"), tmp_path / "out"
    options = "--frames", "0:1", "--workers", "1"
    done = vtkmuscle_("cohort", good, tmp_path / "none.toml", "--out", out, *options, status=Status.FAILED)
    assert "none.toml" in done.stderr
    assert f"wrote {out / 'cohort.csv'}, 2 rows" in done.stdout
    lines = (out / "cohort.csv").read_text().splitlines()
    assert [line.split(",")[0] for line in lines] == ["subject", str(good), str(tmp_path / "none.toml")]


@pytest.mark.slow
def test_a_stop_ends_the_processes(scene, tmp_path):
    def stop(rows):
        raise KeyboardInterrupt

    scenes = {"absent": tmp_path / "none.toml", "anna": scene}
    with pytest.raises(KeyboardInterrupt):
        vtkmuscle.cohort(scenes, tmp_path / "out", workers=2, progress=stop)
    assert active_children() == []
    (folder,) = (tmp_path / "out").glob("anna-*")
    report = ResultFolder(folder).report()
    assert report is None or not report["complete"]


def test_subjects_with_similar_names_keep_their_own_folders_and_rows(scene, tmp_path):
    """Names that differ only in characters that file names lose: the folder has a digest of the name."""
    turned = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=7, resolution=5)
    names = ("a b", "a_b")
    scenes = {name: (scene, turned)[i % 2] for i, name in enumerate(names)}
    table = vtkmuscle.cohort(scenes, tmp_path, workers=1, frames="0:1")
    again = vtkmuscle.cohort(scenes, tmp_path, workers=1, frames="0:1")
    assert len({name.casefold() for name in table["folder"]}) == len(names)
    own = vtkmuscle.cohort({"a b": scene}, workers=1, frames="0:1")
    assert table["length_mm"][0] == own["length_mm"][0]
    assert table["length_mm"].tolist() == again["length_mm"].tolist()
    assert table["length_mm"][0] != table["length_mm"][1]


def test_a_cohort_takes_muscles_and_settings_and_judges_changed_facts_anew(tmp_path, solved):
    """Settings were refused, and a finished folder was read although its scene's file had changed."""
    file, out = write_tiny_scene(tmp_path / "anna"), tmp_path / "out"
    own = {"workers": 1, "frames": "0:2", "muscles": "spindle"}
    first = vtkmuscle.cohort([file], out, **own)
    fewer = vtkmuscle.cohort([file], out, n_fibres=4, **own)
    direct = Scene.load(file).run(frames="0:2", n_fibres=4).lengths["spindle"]
    assert fewer["length_mm"] == pytest.approx(direct.mean(), rel=1e-12)
    assert fewer["length_mm"] != first["length_mm"]
    options = "--frames", "0:2", "--workers", "1", "--muscle", "spindle", "--quality", "preview"
    vtkmuscle_("cohort", file, "--out", out, *options)
    vtkmuscle_("cohort", file, "--out", out, *options)
    assert len(solved) == 4, "a finished folder with equal settings is read"
    file.write_text(file.read_text() + '\n[guessed]\n"units" = 0.1\n')
    vtkmuscle_("cohort", file, "--out", out, *options)
    assert len(solved) == 5
    with pytest.raises(TypeError, match="n_fibres"):
        vtkmuscle.cohort([file], n_fibers=4)
    assert "no muscle 'spindel'" in vtkmuscle.cohort([file], workers=1, muscles="spindel")["message"][0]


@pytest.mark.parametrize("motion", [{"grid": {"upper": [0, 10, 10]}}, {"file": "walk.mot"}])
def test_a_scene_with_joints_is_run_as_it_is(tmp_path, motion):
    """A scene was saved first, without joints: refused for a still coordinate, or without moment arms."""
    save_strap(tmp_path / "strap", n_fibres=4)
    file = scene_with(tmp_path / "strap", tmp_path, motion=motion, deformer="none")
    (file.parent / "walk.mot").write_text("w\ninDegrees=yes\nendheader\ntime upper lower\n0 0 0\n1 5 9\n")
    scene = Scene.load(file)
    of_file, of_scene = vtkmuscle.cohort([file], workers=1), vtkmuscle.cohort(scene, workers=1)
    assert of_scene["moment_arm_upper_mm"].tolist() == of_file["moment_arm_upper_mm"].tolist()
    assert len(Scene.load(scene.save(tmp_path / "saved")).motion.times) == 2
