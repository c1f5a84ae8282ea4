"""No file of the user is overwritten or deleted."""

import json
import os
import shutil
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import pytest
from commands import contents, refused, vtkmuscle_
from faults import files_in
from tiny_scene import write_tiny_scene

from vtkmuscle import Scene, SceneError, phantoms
from vtkmuscle.io.writing import LOCK
from vtkmuscle.run.store.writing import ResultWriter, claimed, remove_results
from vtkmuscle.scene.writing import save_unless_there

QUICK = ("--frames", "0:1", "--no-figures", "--quiet")


@pytest.fixture(scope="module")
def finished(scene, tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished")
    scene.run(folder, frames="0:1", figures=False)
    return folder


@pytest.fixture
def out(finished, tmp_path):
    """A folder of a finished run."""
    return Path(shutil.copytree(finished, tmp_path / "out"))


def test_a_run_is_not_written_over_its_inputs(scene_file):
    before = contents(scene_file.parent)
    for insist in ((), ("--overwrite",)):
        said = refused("run", scene_file, "--out", scene_file.parent, *QUICK, *insist)
        assert "an input (bones.upper.surface)" in said
    with pytest.raises(ValueError, match="an input"):  # changed settings lost the inputs
        Scene.load(scene_file).run(scene_file.parent, overwrite=True, quality="preview")
    for file in (scene_file, scene_file.parent / "bones/upper.vtp"):  # joints, comments and meshes were lost
        with pytest.raises(ValueError, match="an input"):
            replace(Scene.load(scene_file), files={"": file}).save(scene_file.parent)
    assert contents(scene_file.parent) == before


def test_files_that_no_run_has_written_are_not_replaced(scene_file, tmp_path):
    mine = tmp_path / "out/bones/upper.vtp"
    mine.parent.mkdir(parents=True)
    mine.write_text("mine")
    call = "run", scene_file, "--out", tmp_path / "out", *QUICK
    assert "as a command of vtkmuscle has written it" in refused(*call)
    assert mine.read_text() == "mine"
    vtkmuscle_(*call, "--overwrite")
    assert mine.read_text(errors="replace") != "mine"


def test_results_of_another_scene_are_not_replaced(scene_file, tmp_path):
    out = tmp_path / "out"
    other = write_tiny_scene(tmp_path / "other")
    vtkmuscle_("run", other, "--out", out, *QUICK)
    before = contents(out)
    assert "results of the scene 'tiny'" in refused("run", scene_file, "--out", out, *QUICK)
    assert contents(out) == before
    vtkmuscle_("run", scene_file, "--out", out, *QUICK, "--overwrite")
    assert json.loads((out / "report.json").read_text())["scene_file"] == str(scene_file)


def test_nothing_old_stands_beside_new_results(scene, tmp_path):
    muscles = {"old": scene.muscles["spindle"]}
    (tmp_path / "notes.txt").write_text("mine")
    replace(scene, muscles=muscles).run(tmp_path, frames="0:3", figures=False)
    assert (tmp_path / "old/old_0002.vtp").is_file()
    (tmp_path / "old/mine.txt").write_text("mine")
    with pytest.raises(ValueError, match="would remove the finished results of old"):
        scene.run(tmp_path, frames="0:2", figures=False)
    scene.run(tmp_path, frames="0:2", figures=False, overwrite=True)
    found = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert found == {
        *("notes.txt", "old/mine.txt", "report.json", "report.html", "lengths.csv"),
        *("fibre_lengths.csv", "architecture.csv", "spindle_fibres.csv"),
        *("spindle.pvd", "spindle_fibres.pvd", "bones.pvd", "bones/upper.vtp"),
        *(f"{one}/{one}_000{i}.vtp" for one in ("spindle", "spindle_fibres") for i in (0, 1)),
        *(f"bones/lower/lower_000{i}.vtp" for i in (0, 1)),
        *(f"finished/{name}" for name in ("scene.json", "bones/upper.vtp", "bones/lower.vtp")),
        *(f"finished/spindle{ending}" for ending in (".json", ".vtp", "_fibres.vtp")),
    }


def test_a_run_that_fails_leaves_no_old_table_beside_new_frames(scene, tmp_path):
    scene.run(tmp_path, frames="0:3", figures=False, report=False)

    def fail(muscle, stage, part):
        if part > 0.0:
            raise RuntimeError("stopped here")

    with pytest.raises(RuntimeError):
        replace(scene, solver={"iterations": 2}).run(tmp_path, figures=False, progress=fail)
    assert not (tmp_path / "spindle/spindle_0002.vtp").exists()
    assert not (tmp_path / "lengths.csv").exists()
    assert json.loads((tmp_path / "report.json").read_text())["complete"] is False


def test_where_no_report_can_be_written_nothing_is_that_would_stop_the_next_run(scene, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device", "report.json")

    with monkeypatch.context() as patch:
        patch.setattr(ResultWriter, "write_report", full)
        with pytest.raises(OSError, match="No space left"):
            scene.run(tmp_path / "out", frames="0:1", figures=False)
    assert not list((tmp_path / "out").rglob("*"))
    scene.run(tmp_path / "out", frames="0:1", figures=False)


@pytest.mark.parametrize(
    "name",
    [
        *("bones", "spindle", "spindle_fibres", "figures", "finished"),
        *("bones/lower", "bones/link", "spindle/a/link", "finished/bones", "finished/errors"),
    ],
)
def test_results_are_not_written_through_links(scene, out, tmp_path, name):
    """Whether the folder is the user's, or somebody has sent it with a list of what to remove."""
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere/upper.vtp").write_text("mine")
    listed = (out / "bones.pvd").read_text()
    (out / "bones.pvd").write_text(listed.replace("bones/upper.vtp", f"{name}/upper.vtp"))
    if (out / name).exists():
        shutil.rmtree(out / name)
    (out / name).parent.mkdir(exist_ok=True)
    (out / name).symlink_to(tmp_path / "elsewhere")
    for overwrite in (False, True):
        with pytest.raises(NotADirectoryError, match=f"{name} is a link to .*not written through links"):
            scene.run(out, frames="0:1", figures=False, overwrite=overwrite)
    assert contents(tmp_path / "elsewhere") == {tmp_path / "elsewhere/upper.vtp": b"mine"}


def test_a_report_from_elsewhere_removes_only_what_runs_write(scene, out, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere/a.vtp").write_text("mine")
    before = contents(out)
    report = json.loads((out / "report.json").read_text())
    report["muscles"] |= {name: {} for name in (".", "..", "../elsewhere/a", "old", "\0")}
    report["figures"] = {"written": ["..", "/", "../notes.txt"]}
    (out / "report.json").write_text(json.dumps(report))
    lists = (out / "spindle.pvd").read_text()
    for name in ("", ".", "old"):
        for target in ("notes.txt", "old/notes.txt"):
            (out / f"{name}.pvd").write_text(lists.replace("spindle/spindle_0000.vtp", target))
    (out / "old").mkdir()
    for name in ("notes.txt", "old/notes.txt"):
        (out / name).write_text("mine")
    scene.run(out, frames="0:1", figures=False)
    for path in (out / "notes.txt", out / "old/notes.txt", tmp_path / "elsewhere/a.vtp"):
        assert path.read_text() == "mine"
    assert contents(out).keys() >= before.keys()
    (out / "report.json").write_text(json.dumps(report))
    (out / "old/link").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(NotADirectoryError, match="old/link is a link"):
        scene.run(out, frames="0:1", figures=False)


@pytest.mark.parametrize(
    "name", ["report.json", "lengths.csv", "spindle.pvd", "bones.pvd", "spindle_fibres.csv"]
)
def test_a_folder_where_a_file_goes_is_said_before_the_work(scene, tmp_path, name):
    (tmp_path / name).mkdir()
    with pytest.raises(IsADirectoryError, match=name) as failure:
        scene.run(tmp_path, frames="0:1", figures=False)
    assert "partial" not in str(failure.value)
    assert {path.name for path in tmp_path.iterdir()} == {name}


def test_an_empty_name_is_no_folder(scene_file, scene, tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    for command in (("run", scene_file, "--out", ""), ("demo", "--out", "")):
        assert "it is empty" in vtkmuscle_(*command, status=2).output
    with pytest.raises(ValueError, match="out is empty"):
        scene.run("")
    with pytest.raises(ValueError, match="~ is not expanded"):
        scene.run("~/out", frames="0:1")
    assert not list((tmp_path / "here").iterdir())


def test_a_demo_keeps_a_scene_that_is_there(tmp_path):
    def save(*, overwrite=False):
        scene = Scene.from_phantom(phantoms.spindle_over_hinge())
        return save_unless_there(scene, tmp_path / "scene", overwrite=overwrite)

    path = save()
    written = path.read_bytes()
    path.write_bytes(written + b"# my scene\n")
    assert save() == path
    assert path.read_bytes().endswith(b"# my scene\n")
    assert save(overwrite=True) == path
    assert path.read_bytes() == written
    path.unlink()
    (tmp_path / "scene/bones/distal.vtp").write_text("mine")
    with pytest.raises(ValueError, match=r"distal\.vtp: the file exists"):
        save()
    assert not path.exists()
    assert [path.name for path in tmp_path.iterdir()] == ["scene"]


@pytest.mark.parametrize("name", ["report.json", "bones.pvd", "other.VTP", "x.partial", "a/b"])
@pytest.mark.parametrize("kind", ["muscles", "bones", "name"])
def test_names_that_would_be_in_the_way_of_files_are_refused(scene, kind, name):
    if kind == "name":
        changes = {"name": name}
    else:
        old = getattr(scene, kind)
        changes = {kind: {**old, name: next(iter(old.values()))}}
    with pytest.raises(SceneError, match=r"leave out the suffix|use only letters") as failure:
        replace(scene, **changes)
    assert len(str(failure.value).splitlines()) == 1


def test_what_killed_runs_left_half_written_goes_and_what_others_write_stays(scene, out):
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    places = (out, out / "spindle", out / "bones" / "lower")
    for folder in places:
        (folder / f".a.vtp.{ended.pid}-0a1b2c3d.partial").write_text("half")
        (folder / f".a.vtp.{ended.pid}.partial").write_text("half")
        (folder / f".b.vtp.{os.getpid()}-0a1b2c3d.partial").write_text("being written")
        (folder / ".mine.partial").write_text("mine")
    (out / f".figures.{ended.pid}-0a1b2c3d.partial").mkdir()
    scene.run(out, frames="0:1", figures=False)
    left = sorted(path.name for path in out.rglob("*.partial"))
    assert left == sorted([f".b.vtp.{os.getpid()}-0a1b2c3d.partial", ".mine.partial"] * len(places))


def test_a_second_run_into_the_same_folder_is_refused(scene, out):
    with claimed(out, scene, overwrite=False):
        with pytest.raises(BlockingIOError, match=rf"another run is writing here \(process {os.getpid()}\)"):
            scene.run(out, frames="0:1", figures=False)
        refused_in_a_thread = []

        def run():
            try:
                scene.run(out, frames="0:1", figures=False, overwrite=True)
            except BlockingIOError as error:
                refused_in_a_thread.append(error)

        thread = threading.Thread(target=run)
        thread.start()
        thread.join()
        assert len(refused_in_a_thread) == 1
    scene.run(out, frames="0:1", figures=False)
    assert not (out / LOCK).exists()


def test_the_lock_of_a_killed_run_holds_nobody_up(scene, out):
    (out / LOCK).write_text("1\n")
    scene.run(out, frames="0:1", figures=False)
    assert not (out / LOCK).exists()


def test_a_kill_while_old_results_are_removed_leaves_no_list_of_files_that_are_gone(scene, out, monkeypatch):
    count, unlink = 0, Path.unlink

    def look(path, *arguments, **options):
        nonlocal count
        unlink(path, *arguments, **options)
        count += 1
        for collection in out.glob("*.pvd"):
            assert all(file.is_file() for file in files_in(collection)), (path, collection)

    monkeypatch.setattr(Path, "unlink", look)
    remove_results(out, scene)
    assert count > 10
