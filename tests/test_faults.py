"""Signals and full disks: nothing damaged under a final name, and one line that says what is there."""

import json
import random
import signal
import time

import pytest
from commands import vtkmuscle_
from faults import check_whole, ended, killed_at, results, small_disk, started
from tiny_scene import write_tiny_scene

from vtkmuscle import Scene

QUIET = ("--quiet", "--no-figures")


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory):
    """A scene that takes some seconds: 30 frames."""
    path = write_tiny_scene(tmp_path_factory.mktemp("faults") / "scene")
    text = path.read_text()
    motion = text[text.index("[motion]") : text.index("[muscles")]
    hinge = (
        '[motion.hinge]\nbone = "lower"\ncentre = [0, -15, 0]\naxis = [1, 0, 0]\nangles = [0, 20, 0.7]\n\n'
    )
    path.write_text(text.replace(motion, hinge))
    return path


@pytest.fixture(scope="module")
def whole(scene_file, tmp_path_factory):
    """What an uninterrupted run gives."""
    out = tmp_path_factory.mktemp("whole")
    Scene.load(scene_file).run(out, figures=False)
    return results(out)


def moments(pytestconfig, seconds, short, long):
    """Return moments of a run at random, the same each time."""
    rng = random.Random(20210615)
    count = long if pytestconfig.getoption("--long") else short
    return [rng.uniform(0.2, 1.05) * seconds for _ in range(count)]


@pytest.mark.slow
def test_kills_leave_no_damaged_file_and_the_same_command_the_same_result(
    scene_file, whole, tmp_path, pytestconfig, tried
):
    command = ("run", scene_file, *QUIET)
    long, rng, kills = pytestconfig.getoption("--long"), random.Random(20210615), 0
    while kills < (300 if long else 1):
        out = tmp_path / f"{kills}"
        for _ in range(3 if long else 1):  # each goes on where the one before it was killed
            process = started(*command, "--out", out)
            met = killed_at(process, rng.uniform(0.8, 4.2))
            process.communicate()
            assert not met or process.returncode == -signal.SIGKILL
            kills += met
            if met:
                tried.add("a run, killed at a random moment", "used")
            if out.is_dir():
                check_whole(out)
        status, _, errors = ended(started(*command, "--out", out), timeout=600.0 if long else 60.0)
        assert status == 0
        if met and (out / "report.json").exists() and errors:
            assert "contains an unfinished run (it was killed); finished frames: spindle " in errors
        assert results(out) == whole
        assert not list(out.rglob(".*"))


@pytest.mark.slow
@pytest.mark.parametrize(
    "number",
    [signal.SIGTERM, *(pytest.param(one, marks=pytest.mark.long) for one in (signal.SIGINT, signal.SIGHUP))],
)
def test_finished_frames_are_listed_after_a_signal(scene_file, tmp_path, pytestconfig, tried, number):
    for case, moment in enumerate(moments(pytestconfig, 0.6, 1, 12)):
        out = tmp_path / f"{case}"
        process = started("run", scene_file, "--out", out, *QUIET)
        deadline = time.monotonic() + 60.0
        while not (out / "spindle.pvd").exists() and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.01)  # the program itself is loaded, and works
        killed_at(process, 0.4 * moment, number)
        began = time.monotonic()
        status, _, errors = ended(process)
        assert time.monotonic() - began < 20.0
        if status == 0:
            continue  # the last frame was done
        assert status == 128 + number
        assert "Traceback" not in errors
        assert errors.startswith("stopped. ")
        assert len(errors.splitlines()) == 1
        check_whole(out)
        report = json.loads((out / "report.json").read_text())
        listed = (out / "spindle.pvd").read_text().count("<DataSet")
        assert report["complete"] is False
        assert listed > 0
        assert f"spindle {listed}" in errors
        tried.add(f"a run, stopped by {signal.Signals(number).name}", "used")


def full(status, errors, path):
    """Check that a full disk is one line of error that names a file."""
    assert status == 2, errors
    assert len(errors.splitlines()) == 1, errors
    assert errors.startswith("error: ")
    assert str(path) in errors
    assert "partial" not in errors


def test_a_disk_that_runs_full_is_one_line_and_nothing_damaged(scene_file, tmp_path, pytestconfig, tried):
    sizes = (64, 200, 300, 450, 700, 1200) if pytestconfig.getoption("--long") else (200,)
    for kilobytes in sizes:
        with small_disk(tmp_path / "disk", kilobytes) as disk:
            out = disk / "out"
            done = vtkmuscle_("run", scene_file, "--out", out, *QUIET, status=None)
            tried.add("a run on a disk that runs full", "refused" if done.exit_code else "used")
            if done.exit_code == 0:
                continue
            full(done.exit_code, done.stderr, out)
            assert not list(out.rglob(".*.partial"))
            check_whole(out)
            if (out / "report.json").exists():
                assert json.loads((out / "report.json").read_text())["complete"] is False


@pytest.mark.long
def test_a_demo_on_a_full_disk_is_one_line(tmp_path):
    with small_disk(tmp_path / "disk", 100) as disk:
        done = vtkmuscle_("demo", "--out", disk / "demo", "--frames", "0:1", *QUIET, status=2)
        full(done.exit_code, done.stderr, disk / "demo")
