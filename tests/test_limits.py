"""Limits and types: what is too much, or no file, is one clear error and no traceback."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from commands import refused
from slow import slow
from tiny_scene import HINGE, MOTION, edit

from vtkmuscle import Scene
from vtkmuscle.cli import Status

DEEP = "a = " + 500 * "[" + 500 * "]" + "\n"


def run(scene_file):
    return refused("run", scene_file, "--out", scene_file.parent / "out", "--no-figures", "--quiet")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("centre = [0.0, -15.0, 0.0]", f"centre = [{10**400}, 0, 0]"),
        ("iterations = 3", f"stiffness = {10**400}"),
        ("iterations = 3", f"iterations = {10**4000}"),
        ("iterations = 3", f"iterations = {'9' * 5000}"),
        ("iterations = 3", "iterations = 1000000000"),
        ("iterations = 3", "stiffness = [[[[[[[[[[]]]]]]]]]]"),
        ("n_fibres = 6", "n_fibres = 1000000000"),
        ("resolution = 5", "resolution = 1000000000"),
        ('name = "tiny"', 'name = "tiny"\n' + DEEP),
        ('"lower"', '"\\u001b]0;title\\u0007"'),
        (MOTION, HINGE.replace("[0, 20, 5]", "[0, 1, 1e-5]")),
        (MOTION, HINGE.replace("20, 5]", f"{10**400}, 5]")),
    ],
    ids=range(12),
)
def test_numbers_that_nobody_means_are_refused(scene_file, old, new):
    edit(scene_file, old, new)
    words = run(scene_file)
    assert "\x1b" not in words
    assert str(scene_file) in words
    assert not (scene_file.parent / "out").exists()


@pytest.mark.parametrize("where", ["scene", "surface", "motion", "landmarks", "template", "info", "report"])
@pytest.mark.parametrize("kind", ["pipe", "device"])
def test_pipes_and_devices_are_refused(scene_file, tmp_path, where, kind):
    suffix = {"scene": "toml", "motion": "csv", "landmarks": "csv", "template": "toml", "report": "json"}
    path = tmp_path / f"{'report' if where == 'report' else 'odd'}.{suffix.get(where, 'vtp')}"
    if kind == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to("/dev/zero")
    if where == "scene":
        words = refused("run", path, "--quiet")
    elif where == "info":
        words = refused("info", path)
    elif where == "report":
        assert refused("report", tmp_path)
        return
    else:
        old, new = {
            "surface": ("muscles/spindle.vtp", f"{path}"),
            "motion": ("motion.csv", f"{path}"),
            "landmarks": ("attachments/origin.vtp", f"{path}"),
            "template": ('template = "parallel"', f'template_file = "{path}"'),
        }[where]
        edit(scene_file, old, new)
        words = run(scene_file)
    assert "pipe or a device" in words


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is full")
@pytest.mark.parametrize("command", [*slow(["--version"]), ["info", "muscles/spindle.vtp"]], ids=str)
def test_output_that_cannot_be_written_is_no_traceback(scene_file, command):
    program = [sys.executable, "-m", "vtkmuscle", *command]
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            program,
            stdout=full,
            stderr=subprocess.PIPE,
            env={name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"},
            cwd=scene_file.parent,
            text=True,
            check=False,
            timeout=120,
        )
    assert done.returncode == Status.BAD_INPUT
    assert done.stderr.startswith("error: ")
    assert done.stderr.endswith("No space left on device\n")
    assert len(done.stderr.splitlines()) == 1


def test_a_reader_that_ends_ends_the_command_without_a_word(scene_file):
    """``vtkmuscle info FILES | head`` printed "error: Broken pipe"."""
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "vtkmuscle", "info", scene_file.parent / "muscles/spindle.vtp"]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, check=False, timeout=120)
    os.close(writer)
    assert (done.returncode, done.stderr) == (128 + signal.SIGPIPE, b"")


def test_a_path_that_is_no_text_is_refused_before_the_work(scene_file):
    out = scene_file.parent / "o\udcff"
    with pytest.raises(ValueError, match=r"o\\udcff: the path is not UTF-8 text; rename"):
        Scene.load(scene_file).run(out, figures=False)
    assert not out.exists()
    with pytest.raises(ValueError, match="not UTF-8 text"):
        Scene.load(scene_file.parent / "s\udcff.toml")
    assert r"o\udcff: the path is not UTF-8 text; rename" in refused("demo", "--out", out)
    assert not out.exists()
