"""Muscles that several processes solve are those that one solves, and none outlives its run."""

import json
import os
import signal
import subprocess
import sys
import time
import warnings
from contextlib import ExitStack
from dataclasses import replace
from multiprocessing import resource_tracker
from multiprocessing.process import BaseProcess

import pytest
from faults import children, results
from tiny_scene import write_tiny_scene

from vtkmuscle import Scene, hinge
from vtkmuscle.data.arrays import points_of, surface_from, triangles_of
from vtkmuscle.io.children import interrupts_blocked, processes
from vtkmuscle.run.pool import pool_size
from vtkmuscle.scene.data import SceneError

FIRST, SECOND, _ = NAMES = ("first", "second", "third")
FRAMES = 5
OPTIONS = {"workers": 2, "figures": False, "report": False}


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Three muscles, of which only the number of fibres differs."""
    one = Scene.load(write_tiny_scene(tmp_path_factory.mktemp("scene")))
    muscle = one.muscles["spindle"]
    fibres = [dict(muscle.fibres, n_fibres=count) for count in (5, 4, 3)]
    return replace(one, muscles={n: replace(muscle, fibres=f) for n, f in zip(NAMES, fibres, strict=True)})


@pytest.fixture
def started(noted):
    """The processes that pools have started."""
    return noted(BaseProcess, "start", lambda process: process)


def report_of(folder):
    return json.loads((folder / "report.json").read_text(encoding="utf-8"))


def without_times(report):
    for muscle in report["muscles"].values():
        del muscle["seconds"]
        for row in muscle["frames"]:
            del row["ms"], row["ms_fibres"]
    return report["muscles"]


def test_other_processes_write_and_warn_as_this_one_does(scene, tmp_path, started):
    bone = scene.bones["lower"]
    open_bone = surface_from(points_of(bone), triangles_of(bone, "lower")[1:])
    scene = replace(scene, bones={**scene.bones, "lower": open_bone})
    warned, parts = {}, {name: [] for name in NAMES}

    def note(muscle, stage, part):
        if stage == "deforming":
            parts[muscle].append(part)

    for workers in (1, 2):
        assert not started
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("default")
            scene.run(tmp_path / f"{workers}", **{**OPTIONS, "workers": workers}, progress=note)
        warned[workers] = [(one.category, str(one.message)) for one in caught]
    assert warned[1] == warned[2]
    assert "block 'lower': the surface is open: 1 hole(s)" in warned[1][0][1]
    assert len(started) == 2
    assert not any(process.is_alive() for process in started)
    assert parts == {name: 2 * [frame / FRAMES for frame in range(FRAMES)] for name in NAMES}
    one, other = results(tmp_path / "1"), results(tmp_path / "2")
    assert one.keys() == other.keys()
    assert not [path for path in one if one[path] != other[path]]
    assert without_times(report_of(tmp_path / "1")) == without_times(report_of(tmp_path / "2"))
    kept = scene.run(tmp_path / "2", workers=1, figures=False, report=False)
    assert kept.report["taken_over"] == list(NAMES)


@pytest.mark.slow
def test_a_fault_there_is_the_one_here(scene, tmp_path):
    far = replace(scene.muscles[SECOND], fixing={"method": "proximity", "distance": 1e-9})
    faulty = replace(scene, muscles={**scene.muscles, SECOND: far})
    with pytest.raises(SceneError) as here:
        faulty.run()
    with pytest.raises(SceneError) as there:
        faulty.run(tmp_path, **OPTIONS)
    assert str(here.value) == str(there.value)
    assert there.value.key == f"muscles.{SECOND}"
    assert report_of(tmp_path)["stopped_by"].startswith("SceneError: ")


@pytest.mark.slow
def test_a_stop_ends_all_processes_and_keeps_the_muscles_that_are_finished(scene, tmp_path, started):
    def stop(muscle, stage, fraction):
        if stage == "done":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        scene.run(tmp_path, **OPTIONS, progress=stop)
    assert not any(process.is_alive() for process in started)
    assert report_of(tmp_path)["complete"] is False
    assert not list(tmp_path.rglob(".*"))
    finished = {path.stem for path in (tmp_path / "finished").glob("*.json")}
    assert finished
    assert set(scene.run(tmp_path, figures=False, report=False).report["taken_over"]) == finished


def wait_for_end(processes):
    deadline = time.monotonic() + 60.0
    while [one for one in processes if os.path.exists(f"/proc/{one}/cmdline")]:
        assert time.monotonic() < deadline
        time.sleep(0.05)


@pytest.mark.slow
def test_ctrl_c_ends_all_processes(scene, tmp_path):
    """As a terminal does it: every process of the group gets the signal."""
    slow = hinge("lower", (0, -15, 0), (1, 0, 0), [20.0 * i / 1000 for i in range(1001)])
    path = replace(scene, motion=slow, files={}).save(tmp_path / "scene")
    command = [sys.executable, "-m", "vtkmuscle", "run", str(path), "--out", str(tmp_path / "out")]
    program = subprocess.Popen(
        [*command, "--workers", "2", "--no-figures"],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    while not list(tmp_path.glob("out/first/*.vtp")):
        assert program.poll() is None
        time.sleep(0.01)
    processes = children(program.pid)
    assert len(processes) >= 2
    os.killpg(program.pid, signal.SIGINT)
    _, said = program.communicate(timeout=60.0)
    assert program.returncode == 130
    assert "Traceback" not in said
    wait_for_end(processes)


def test_ctrl_c_stays_blocked_as_the_first_process_starts(monkeypatch):
    tracker = resource_tracker.ResourceTracker()  # the first one: its start unblocks Ctrl-C
    monkeypatch.setattr(resource_tracker, "ensure_running", tracker.ensure_running)
    with interrupts_blocked():
        resource_tracker.ensure_running()
        assert signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ())
    tracker._stop()


def test_the_end_of_a_pool_ends_no_processes_of_another_one():
    with ExitStack() as first, processes(1) as other:
        pool = first.enter_context(processes(1))
        assert pool.submit(os.getpid).result() != other.submit(os.getpid).result()
        first.close()
        assert other.submit(abs, -1).result() == 1


@pytest.mark.slow
@pytest.mark.parametrize("piped", [False, True])
def test_a_program_need_not_guard_its_work(scene, tmp_path, piped):
    """A process would else import the program, and begin its work anew, or miss the file of a piped one."""
    file = scene.save(tmp_path / "scene")
    program = tmp_path / "program.py"
    program.write_text(
        f"import vtkmuscle\nscene = vtkmuscle.Scene.load({str(file)!r})\n"
        "print(len(scene.run(frames='0:1', workers=2, figures=False).lengths), 'lengths', __spec__)\n"
    )
    command, given = [sys.executable, *([] if piped else [program])], program.read_text() if piped else None
    said = subprocess.run(command, input=given, capture_output=True, text=True, check=False)
    assert (said.returncode, said.stdout) == (0, "3 lengths None\n"), said.stderr


@pytest.mark.slow
def test_a_process_that_is_killed_ends_the_run_with_a_remedy(scene, tmp_path, started):
    def kill(muscle, stage, part):
        started[0].kill()

    with pytest.raises(ChildProcessError, match=r"ended early: .* use fewer workers"):
        scene.run(tmp_path, **OPTIONS, progress=kill)
    assert report_of(tmp_path)["complete"] is False


def test_muscles_that_may_meet_and_a_single_muscle_stay_in_one_process(scene):
    assert pool_size(scene, 1) == 1
    assert pool_size(scene, 2) == 2
    assert pool_size(scene, 9) == 3
    assert 1 <= pool_size(scene, None) <= 3
    assert pool_size(replace(scene, muscle_contact="measure"), 3) == 1
    assert pool_size(scene.with_muscles(FIRST), 3) == 1
