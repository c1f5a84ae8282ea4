"""Muscles that another process solves are those that this one solves, and what ends it does no other harm."""

import json
import subprocess
import sys
import threading
import time
import warnings
from dataclasses import replace

import numpy as np
import pytest
import pyvista
from tiny_scene import write_tiny_scene

from vtkmuscle import Scene
from vtkmuscle.core.machine import processors
from vtkmuscle.data.arrays import points_of
from vtkmuscle.io import child_process, read_polydata
from vtkmuscle.run import workers
from vtkmuscle.run.cost import VARIABLE
from vtkmuscle.run.workers import count_of
from vtkmuscle.scene.faults import SceneError

FIRST, SECOND, THIRD = NAMES = ("first", "second", "third")
FRAMES = 5
PATIENCE = 120.0


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Three muscles, of which only the number of fibres differs: they begin in this order."""
    one = Scene.load(write_tiny_scene(tmp_path_factory.mktemp("scene")))
    muscle = one.muscles["spindle"]
    fibres = [dict(muscle.fibres, n_fibres=count) for count in (5, 4, 3)]
    return replace(one, muscles={n: replace(muscle, fibres=f) for n, f in zip(NAMES, fibres, strict=True)})


@pytest.fixture
def started(monkeypatch):
    """The processes of Python that were started."""
    processes = []

    class Noted(subprocess.Popen):
        def __init__(self, *args, **more):
            super().__init__(*args, **more)
            if self.args[0] == sys.executable:
                processes.append(self)

    monkeypatch.setattr(subprocess, "Popen", Noted)
    return processes


class Meeting:
    """Holds the first muscle, which this process solves, in its second frame until another one has begun."""

    def __init__(self, then=lambda muscle, row: None):
        self.begun, self.rows, self.then = threading.Event(), {name: [] for name in NAMES}, then
        self.options = {"workers": 2, "figures": False, "report": False}
        self.options |= {"observe": self.observe, "progress": self.progress}

    def progress(self, muscle, stage, fraction):
        if muscle != FIRST:
            self.begun.set()

    def observe(self, muscle, row):
        self.rows[muscle].append(row["frame"])
        if muscle == FIRST and row["frame"] == 1:
            assert self.begun.wait(PATIENCE)
        self.then(muscle, row)


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


def test_another_process_writes_what_this_one_writes(scene, tmp_path, started):
    scene.run(tmp_path / "1", workers=1, figures=False, report=False)
    assert not started
    meeting = Meeting()
    scene.run(tmp_path / "2", **meeting.options)
    assert len(started) == 1
    assert started[0].returncode is not None
    assert meeting.rows == {name: list(range(FRAMES)) for name in NAMES}
    one, other = files(tmp_path / "1"), files(tmp_path / "2")
    assert one.keys() == other.keys()
    assert not [path for path in one if one[path] != other[path]]
    assert without_times(report_of(tmp_path / "1")) == without_times(report_of(tmp_path / "2"))
    kept = scene.run(tmp_path / "2", workers=1, figures=False, report=False)
    assert kept.report["taken_over"] == list(NAMES)


def test_another_process_gives_what_this_one_gives(scene):
    alone, result = scene.run(workers=1), scene.run(**Meeting().options)
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
        faulty.run(workers=1)
    with pytest.raises(SceneError) as there:
        faulty.run(tmp_path, **Meeting().options)
    assert str(here.value) == str(there.value)
    assert there.value.key == f"muscles.{SECOND}"
    assert report_of(tmp_path)["stopped_by"].startswith("SceneError: ")


def test_a_warning_there_is_one_here(scene):
    near = replace(scene.muscles[SECOND], fixing={"method": "proximity", "distance": 100.0})
    fixed = replace(scene, muscles={**scene.muscles, SECOND: near})
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        fixed.run(frames="0:2", **Meeting().options)
    told = [one for one in caught if "points are fixed to bones: none is free" in str(one.message)]
    assert [one.category for one in told] == [UserWarning]
    assert str(told[0].message).startswith(f"muscles.{SECOND}: all ")


@pytest.mark.parametrize("error", [RuntimeError("enough"), KeyboardInterrupt()])
def test_a_stop_leaves_the_frames_that_are_done_there(error, scene, tmp_path, started):
    def stop(muscle, row):
        if muscle == SECOND and row["frame"] == 2:
            raise error

    with pytest.raises(type(error)):
        scene.run(tmp_path, **Meeting(stop).options)
    assert started[0].returncode is not None
    done = len(report_of(tmp_path)["muscles"][SECOND]["frames"])
    assert 3 <= done <= FRAMES
    assert (tmp_path / f"{SECOND}.pvd").read_text().count("<DataSet") == done
    rows = (tmp_path / "lengths.csv").read_text().splitlines()
    assert sum(row.startswith(f"{SECOND},") for row in rows) == 4 * done
    assert not list(tmp_path.rglob(".*"))


def test_a_process_that_crashes_ends_the_run_with_its_muscle(scene, tmp_path, started):
    def kill(muscle, row):
        if muscle == SECOND:
            started[0].kill()

    muscle = scene.muscles[SECOND]
    slow = replace(muscle, fibres={**muscle.fibres, "resolution": 200})
    killed = replace(scene, muscles={**scene.muscles, SECOND: slow})
    words = rf"muscles\.{SECOND}: the process that solved it crashed \(SIGKILL\).* workers = 1"
    with pytest.raises(RuntimeError, match=words):
        killed.run(tmp_path, **Meeting(kill).options)
    assert report_of(tmp_path)["complete"] is False


@pytest.mark.parametrize("part", [0, 1000])
def test_a_process_ends_with_the_one_that_asks(part, scene):
    """That one may be killed at any time: before its first question, or in the midst of it."""
    process = child_process.ChildProcess(workers._solve_muscles)
    watch = threading.Timer(PATIENCE, process.kill)
    watch.start()
    process.send(child_process.pickled((scene, range(FRAMES), time.perf_counter))[:part])
    process.stop()
    with pytest.raises(child_process.ChildEndedError) as ended:
        process.receive()
    assert ended.value.status == 0
    watch.cancel()
    process.close()


def test_where_no_process_can_be_started_this_one_solves_all(scene, monkeypatch):
    monkeypatch.setattr(
        child_process, "python_command", lambda code: [sys.executable, "-c", "raise SystemExit(3)"]
    )
    slow = threading.Event()
    with pytest.warns(
        UserWarning, match="a process that solves muscles ended with status 3; others solve them"
    ):
        result = scene.run(workers=2, observe=lambda *_: slow.wait(0.1))
    assert set(result.verdicts.values()) == {"ok"}


def test_processes_are_started_where_they_are_worth_it_and_there_is_memory(scene, monkeypatch):
    assert count_of(scene, range(FRAMES), None) == 1
    assert count_of(scene, range(FRAMES), 2) == 2
    assert count_of(scene, range(FRAMES), 9) == 3
    assert count_of(scene, range(10**5), None, on_disk=True) == min(3, processors())
    monkeypatch.setenv(VARIABLE, "0.3")
    assert count_of(scene, range(10**5), None, on_disk=True) == 1
    assert count_of(scene, range(10**5), 3, on_disk=True) == 3
    assert count_of(replace(scene, muscle_contact="measure"), range(10**5), 3) == 1
