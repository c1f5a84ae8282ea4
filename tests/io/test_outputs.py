"""Nothing of the user's is replaced by any command; the files of a command appear together or not at all."""

import errno
import os
import signal
import subprocess
import sys

import pytest
from commands import contents, refused, vtkmuscle_
from slow import slow

from vtkmuscle import Scene
from vtkmuscle.data.arrays import blocks_of
from vtkmuscle.io import write_polydata, write_text
from vtkmuscle.io.writing import LOCK, RECORD, Outputs
from vtkmuscle.phantoms import hip
from vtkmuscle.scene.writing import write_areas


def write(folder, **files):
    """Write texts by one command."""
    with Outputs(folder):
        for name, text in files.items():
            write_text(folder / "sub" / name, text)


def texts(folder):
    return {path.name: path.read_text() for path in (folder / "sub").iterdir()}


def test_files_of_a_command_are_replaced_and_edited_files_are_not(tmp_path):
    out = tmp_path / "out"
    write(out, a="1", b="1")
    write(out, a="2", b="2")
    assert texts(out) == {"a": "2", "b": "2"}
    (out / "sub/b").write_text("mine")
    with pytest.raises(ValueError, match=r"sub/b: the file exists.*--overwrite"):
        write(out, a="3", b="3")
    assert texts(out) == {"a": "2", "b": "mine"}
    with Outputs(out, overwrite=True):
        write_text(out / "sub/b", "3")
    assert texts(out) == {"a": "2", "b": "3"}


def test_inputs_and_links_are_never_replaced(tmp_path):
    for overwrite in (False, True):
        (tmp_path / "input").write_text("mine")
        with (
            pytest.raises(ValueError, match="would replace an input"),
            Outputs(tmp_path, inputs=[tmp_path / "input"], overwrite=overwrite),
        ):
            write_text(tmp_path / "input", "1")
        (tmp_path / "elsewhere").mkdir(exist_ok=True)
        if not overwrite:
            (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
            (tmp_path / "file").symlink_to(tmp_path / "input")
        for name in ("link/a", "file"):
            with (
                pytest.raises(NotADirectoryError, match="is a link to"),
                Outputs(tmp_path, overwrite=overwrite),
            ):
                write_text(tmp_path / name, "1")
    assert (tmp_path / "input").read_text() == "mine"
    assert not list((tmp_path / "elsewhere").iterdir())


def test_a_file_in_place_of_a_folder_is_named(tmp_path):
    (tmp_path / "notes").write_text("mine")
    for folder in (tmp_path / "notes", tmp_path / "notes/deep"):
        with pytest.raises(NotADirectoryError, match=r"notes is a file; give another folder"):
            Outputs.for_file(folder / "a", ())
        with pytest.raises(OSError, match=r"notes(/deep)?'$"):
            write_text(folder / "a", "1")


def test_the_names_of_temporary_files_are_not_told(tmp_path, monkeypatch):
    def denied(path, *_):
        raise PermissionError(errno.EACCES, "denied", str(path))

    monkeypatch.setattr(os, "mkdir", denied)
    with pytest.raises(PermissionError, match=r"sub/a'$"):
        write(tmp_path, a="1")


def test_a_command_that_fails_leaves_nothing(tmp_path):
    def command():
        with Outputs(tmp_path / "new/deep"):
            write_text(tmp_path / "new/deep/sub/a", "1")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        command()
    assert not list(tmp_path.iterdir())


KILLED = """
import sys
from pathlib import Path
from vtkmuscle.data.arrays import blocks_of
from vtkmuscle.io import write_polydata, write_text
from vtkmuscle.io.writing import Outputs
moves, replace = [], Path.replace
def counted(self, to):
    moves.append(to)
    if len(moves) == int(sys.argv[2]):
        import os, signal
        os.kill(os.getpid(), signal.SIGKILL)
    return replace(self, to)
Path.replace = counted
with Outputs(Path(sys.argv[1])) as outputs:
    for name in "abc":
        write_text(Path(sys.argv[1]) / "sub" / name, sys.argv[2])
"""


@pytest.mark.skipif(os.name != "posix", reason="needs SIGKILL")
@pytest.mark.parametrize("move", [*slow(1, 2), 3, *slow(4)])
def test_a_killed_command_goes_on(tmp_path, move):
    """Killed before the record, and before each file is moved: files are whole, and none is refused."""
    write(tmp_path, a="0", b="0", c="0")
    done = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path), str(move)], check=False)
    assert done.returncode == -signal.SIGKILL
    assert list(texts(tmp_path).values()).count(str(move)) == max(0, move - 2)
    write(tmp_path, a="2", b="2", c="2")
    assert texts(tmp_path) == dict.fromkeys("abc", "2")
    assert {path.name for path in tmp_path.iterdir()} <= {"sub", RECORD, LOCK}


def test_init_keeps_landmarks_and_a_corrected_scene(tmp_path):
    """Landmarks where init would write its own are inputs; a scene that was corrected is the user's."""
    phantom = hip(detail=0.5)
    bones = dict(blocks_of(phantom.bones))
    surfaces = {"pelvis": bones["pelvis"], "femur": bones["femur"], "iliacus": phantom.muscles["iliacus"]}
    for name, surface in surfaces.items():
        write_polydata(tmp_path / f"{name}.vtp", surface)
    (tmp_path / "attachments").mkdir()
    landmarks = tmp_path / "attachments/iliacus_origin_0.mrk.json"
    write_areas(tmp_path, "iliacus", Scene.from_phantom(phantom).muscles["iliacus"].attachments[:1])
    meshes = [tmp_path / f"{name}.vtp" for name in surfaces]
    before = contents(tmp_path)
    for insist in ((), ("--overwrite",)):
        said = refused("init", *meshes, landmarks, "--out", tmp_path, *insist)
        assert "would replace an input" in said
        assert contents(tmp_path) == before
    landmarks.unlink()
    (tmp_path / "volumes.csv").write_text("mine")
    assert "volumes.csv: the file exists" in refused("init", *meshes, "--out", tmp_path)
    assert (tmp_path / "volumes.csv").read_text() == "mine"
    (tmp_path / "volumes.csv").unlink()
    for _ in range(2):
        vtkmuscle_("init", *meshes, "--out", tmp_path)
    (tmp_path / "scene.toml").write_text("# corrected")
    assert "scene.toml: the file exists" in refused("init", *meshes, "--out", tmp_path)
    assert (tmp_path / "scene.toml").read_text() == "# corrected"
