"""Muscles that several processes solve are those that one solves, and none outlives its run."""

import json
import os
import signal
import subprocess
import sys
import time
import warnings
from dataclasses import replace

import numpy as np
import pytest
import pyvista
from faults import children
from tiny_scene import write_tiny_scene

from vtkmuscle import Scene
from vtkmuscle.data.arrays import points_of
from vtkmuscle.io import read_polydata
from vtkmuscle.run import pool
from vtkmuscle.run.pool import pool_size
from vtkmuscle.scene.faults import SceneError

FIRST, SECOND, THIRD = NAMES = ("first", "second", "third")
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
def started(monkeypatch):
    """The processes that pools have started."""
    processes = []

    class Noted(pool._Context):
        def __init__(self):
            super().__init__()
            self.started = processes

    monkeypatch.setattr(pool, "_Context", Noted)
    return processes


def report_of(folder):
    return json.loads((folder / "report.json").read_text(encoding="utf-8"))


def without_times(report):
    for muscle in report["muscles"].values():
        del muscle["seconds"]
        for row in muscle["frames"]:
            del row["ms"], row["ms_fibres"]
    return report["muscles"]


def content_of(path):
    """Return what a file of a run holds: of data their points, cells and arrays, bit for bit."""
    if path.suffix != ".vtp":
        return path.read_bytes()
    data = read_polydata(path)
    one = pyvista.wrap(data)
    arrays = {
        (kind, name): np.asarray(values[name]).tobytes()
        for kind, values in (("point", one.point_data), ("cell", one.cell_data), ("field", one.field_data))
        for name in values
        if name != "Milliseconds"
    }
    return arrays | {"points": one.points.tobytes(), "cells": one.faces.tobytes() + one.lines.tobytes()}


def files(folder):
    """Return the content of the files of a folder, but for those that have times or digests of such."""
    found = (path for path in folder.rglob("*") if path.suffix in (".vtp", ".pvd", ".csv"))
    return {path.relative_to(folder): content_of(path) for path in found}


def test_other_processes_write_and_warn_as_this_one_does(scene, tmp_path, started):
    near = replace(scene.muscles[SECOND], fixing={"method": "proximity", "distance": 100.0})
    scene = replace(scene, muscles={**scene.muscles, SECOND: near})
    warned, rows = {}, {name: [] for name in NAMES}
    for workers in (1, 2):
        assert not started
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("default")
            scene.run(
                tmp_path / f"{workers}",
                **{**OPTIONS, "workers": workers},
                observe=lambda muscle, row: rows[muscle].append(row["frame"]),
            )
        warned[workers] = [(one.category, str(one.message)) for one in caught]
    assert warned[1] == warned[2]
    assert warned[1][0][1].startswith(f"muscles.{SECOND}: all ")
    assert len(started) == 2
    assert not any(process.is_alive() for process in started)
    assert rows == {name: 2 * list(range(FRAMES)) for name in NAMES}
    one, other = files(tmp_path / "1"), files(tmp_path / "2")
    assert one.keys() == other.keys()
    assert not [path for path in one if one[path] != other[path]]
    assert without_times(report_of(tmp_path / "1")) == without_times(report_of(tmp_path / "2"))
    kept = scene.run(tmp_path / "2", workers=1, figures=False, report=False)
    assert kept.report["taken_over"] == list(NAMES)


def test_other_processes_give_what_this_one_gives(scene):
    bones = {name: pyvista.wrap(bone) for name, bone in scene.bones.items()}
    alone, result = scene.run(), replace(scene, bones=bones).run(workers=2)
    for name in NAMES:
        assert alone.lengths[name].tobytes() == result.lengths[name].tobytes()
        for frame in range(FRAMES):
            for kind in ("muscle", "fibres"):
                one, other = (getattr(run, kind)(name, frame=frame) for run in (alone, result))
                np.testing.assert_array_equal(points_of(one), points_of(other))
            assert other.GetCellData().GetNumberOfArrays() > 5
        track = result._tracks[name]  # what is kept in memory shares the triangles
        rest, bent = (data.GetPolys() for data in (track.rest, track.surfaces[-1]))
        assert rest.GetConnectivityArray() is bent.GetConnectivityArray()
        assert np.array(alone.fibre_lengths[name]).tobytes() == np.array(result.fibre_lengths[name]).tobytes()


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
    again = scene.run(tmp_path, figures=False, report=False)
    assert set(again.report["taken_over"]) == finished


def wait_for_end(processes):
    deadline = time.monotonic() + 60.0
    while [one for one in processes if os.path.exists(f"/proc/{one}/cmdline")]:
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_ctrl_c_ends_all_processes(scene, tmp_path):
    """As a terminal does it: every process of the group gets the signal."""
    path = scene.save(tmp_path / "scene")
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


def test_processes_end_with_the_one_that_started_them(scene, tmp_path):
    path = scene.save(tmp_path / "scene")
    command = [sys.executable, "-m", "vtkmuscle", "run", str(path), "--out", str(tmp_path / "out")]
    program = subprocess.Popen([*command, "--workers", "2", "--no-figures", "--quiet"])
    while not list(tmp_path.glob("out/first/*.vtp")):
        assert program.poll() is None
        time.sleep(0.01)
    processes = children(program.pid)
    program.kill()
    program.wait()
    wait_for_end(processes)


def test_a_process_that_is_killed_ends_the_run_with_a_remedy(scene, tmp_path, started):
    def kill(muscle, row):
        started[0].kill()

    with pytest.raises(ChildProcessError, match=r"ended early: .* use fewer workers"):
        scene.run(tmp_path, **OPTIONS, observe=kill)
    assert report_of(tmp_path)["complete"] is False


def test_a_script_is_not_run_again_by_its_processes(scene, tmp_path):
    path = scene.save(tmp_path / "scene")
    script = tmp_path / "script.py"
    script.write_text(
        f"print('begun')\nfrom vtkmuscle import Scene\n"
        f"print(Scene.load({str(path)!r}).run(workers=2, frames=0).report['complete'], __name__)\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "begun\nTrue __main__\n"), done.stderr


def test_muscles_that_may_meet_and_a_single_muscle_stay_in_one_process(scene):
    assert pool_size(scene, 1) == 1
    assert pool_size(scene, 2) == 2
    assert pool_size(scene, 9) == 3
    assert 1 <= pool_size(scene, None) <= 3
    assert pool_size(replace(scene, muscle_contact="measure"), 3) == 1
    assert pool_size(scene.with_muscles(FIRST), 3) == 1
