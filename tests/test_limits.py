"""Limits and types: what is too much, or no file, is one clear error and no traceback."""

import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from tiny_scene import HINGE, TOML, write_tiny_scene
from typer.testing import CliRunner

from vtkmuscle import Scene
from vtkmuscle.cli import BAD_INPUT, app
from vtkmuscle.core.template.kinds import read_template
from vtkmuscle.filters import FibreTemplateSource, FibreTubes, PBDDeformer
from vtkmuscle.io import read_landmarks, read_motion_table, read_polydata

MOTION = TOML[TOML.index("[motion]") : TOML.index("[muscles")]
DEEP = "a = " + 500 * "[" + 500 * "]" + "\n"


@pytest.fixture
def scene_file(tmp_path):
    return write_tiny_scene(tmp_path / "scene")


def change(scene_file, old, new):
    text = scene_file.read_text()
    assert old in text
    scene_file.write_text(text.replace(old, new))


def refused(*arguments):
    """Run the program, expect a line for each fault and nothing else, and return them."""
    done = CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)
    assert done.exit_code == BAD_INPUT
    lines = done.stderr.splitlines()
    assert lines
    assert all(line.startswith("error: ") and len(line) < 600 for line in lines)
    return done.stderr


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
    change(scene_file, old, new)
    words = run(scene_file)
    assert "\x1b" not in words
    assert str(scene_file) in words
    assert not (scene_file.parent / "out").exists()


def test_a_large_whole_number_is_a_number(scene_file):
    change(scene_file, "centre = [0.0, -15.0, 0.0]", "centre = [0, -15, 100000000000000000000]")
    assert Scene.load(scene_file).motion.centre[2] == 1e20


@pytest.mark.parametrize("suffix", ["toml", "json"])
def test_templates_that_are_too_deep_or_too_long_are_refused(tmp_path, suffix):
    path = tmp_path / f"t.{suffix}"
    deep = 100_000 if suffix == "json" else 500
    path.write_text(("sheets = " if suffix == "toml" else "") + deep * "[" + deep * "]")
    with pytest.raises(ValueError, match="the template"):
        read_template(path)
    with path.open("wb") as file:
        file.truncate(65 * 1024**2)
    with pytest.raises(ValueError, match="at most 64 MB"):
        read_template(path)


def test_landmarks_that_are_no_table_are_refused(tmp_path):
    (tmp_path / "deep.json").write_text(100_000 * "[" + 100_000 * "]")
    with pytest.raises(ValueError, match="not a JSON list"):
        read_landmarks(tmp_path / "deep.json")
    (tmp_path / "long.csv").write_text('x,y,z\n1,2,3\n"' + 140_000 * "a")
    with pytest.raises(ValueError, match="not a CSV table"):
        read_landmarks(tmp_path / "long.csv")


def test_a_motion_of_too_many_rows_is_refused(tmp_path):
    header = "time," + ",".join(f"T{row}{column}" for row in range(3) for column in range(4))
    row = ",1,0,0,0,0,1,0,0,0,0,1,0"
    (tmp_path / "m.csv").write_text(header + "\n" + "\n".join(f"{i}{row}" for i in range(50_000)))
    with pytest.raises(ValueError, match="more than 20000 rows"):
        read_motion_table(tmp_path / "m.csv", "bone")


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
        change(scene_file, old, new)
        words = run(scene_file)
    assert "pipe or a device" in words


def test_a_message_of_vtk_that_is_no_text_is_one(tmp_path):
    # A data set whose name has a byte of no text: VTK's complaint repeats it.
    (tmp_path / "a.vtk").write_bytes(b"# vtk DataFile Version 3.0\nx\nASCII\nDATASET \xff\xfe\n")
    with pytest.raises(ValueError, match=r"cannot be read|damaged|not a surface") as failure:
        read_polydata(tmp_path / "a.vtk")
    assert len(str(failure.value).splitlines()) == 1


def test_maxima_are_stated():
    for kind, name in (
        (PBDDeformer, "iterations"),
        (PBDDeformer, "solved_triangles"),
        (FibreTemplateSource, "n_fibres"),
        (FibreTemplateSource, "resolution"),
        (FibreTubes, "sides"),
    ):
        with pytest.raises(ValueError, match=r"<= \d"):
            setattr(kind(), name, 10**9)
        with pytest.raises(ValueError, match=r"<= \d"):
            setattr(kind(), name, 10**400)


def test_not_enough_memory_is_one_line(scene_file, monkeypatch):
    def fail(path):
        raise MemoryError

    monkeypatch.setattr(Scene, "load", fail)
    assert "not enough memory" in run(scene_file)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is full")
@pytest.mark.parametrize(
    "command", [["--version"], ["info", "muscles/spindle.vtp"]], ids=["here", "in a command"]
)
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
    assert done.returncode == BAD_INPUT
    assert done.stderr.startswith("error: ")
    assert done.stderr.endswith("No space left on device\n")
    assert len(done.stderr.splitlines()) == 1


def test_a_path_that_is_no_text_is_refused_before_the_work(scene_file):
    out = scene_file.parent / "o\udcff"
    with pytest.raises(ValueError, match=r"o\\udcff: this path is not text in UTF-8; rename"):
        Scene.load(scene_file).run(out, figures=False)
    assert not out.exists()
    with pytest.raises(ValueError, match="not text in UTF-8"):
        Scene.load(scene_file.parent / "s\udcff.toml")
    assert r"o\udcff: this path is not text in UTF-8; rename" in refused("demo", "--out", out)
    assert not out.exists()


def test_a_report_that_is_no_report_is_no_traceback(tmp_path):
    for content in ("[]", "{", json.dumps({"muscles": 3})):
        (tmp_path / "report.json").write_text(content)
        assert refused("report", tmp_path)


def test_sizes_beyond_all_memory_are_seen_in_the_file(tmp_path):
    piece = '<Piece NumberOfPoints="9999999999999999999"/>'
    (tmp_path / "a.vtp").write_text(f'<VTKFile type="PolyData"><PolyData>{piece}</PolyData></VTKFile>')
    with pytest.raises(ValueError, match="NumberOfPoints"):
        read_polydata(tmp_path / "a.vtp")


def test_what_is_done_before_the_first_frame_grows_no_faster_than_the_motion(tmp_path):
    def calls_before_the_first_frame(count):
        text = write_tiny_scene(tmp_path / str(count)).read_text()
        start, end = text.index("[motion]"), text.index("[muscles.spindle]")
        motion = HINGE.replace("[0, 20, 5]", f"[0, 20, {20 / count}]") + "\n"
        file = tmp_path / str(count) / "scene.toml"
        file.write_text(text[:start] + motion + text[end:])
        calls = 0

        def count_calls(frame, event, argument):
            nonlocal calls
            calls += 1

        def stop(muscle, row):
            raise KeyboardInterrupt

        threading.setprofile(count_calls)
        sys.setprofile(count_calls)
        try:
            with pytest.raises(KeyboardInterrupt):
                Scene.load(file).run(tmp_path / str(count) / "out", figures=False, observe=stop, workers=1)
        finally:
            threading.setprofile(None)
            sys.setprofile(None)
        return calls

    calls_before_the_first_frame(10)  # what is compiled and imported
    few, some, many = map(calls_before_the_first_frame, (50, 450, 850))
    assert many - some < 1.2 * (some - few), (few, some, many)
