"""The processor time of a run is all of it in the stages, and in those that use it."""

from __future__ import annotations

import sys
import threading
import time
from importlib import import_module
from operator import attrgetter

import pytest

from vtkmuscle import Scene, phantoms

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has clocks of other threads")


def busy(seconds):
    """Use the processor for so long, by this thread's own clock."""
    end = time.thread_time() + seconds
    while time.thread_time() < end:
        pass


def idle(event):
    """Use none of it."""
    event.wait()


def test_time_is_of_the_thread_that_uses_it():
    """Of two threads the one that waits has none; a third of a second is found, whoever else is at work."""
    from sampling import OTHER, Sampling, by_stage

    end = threading.Event()
    waiting = threading.Thread(target=idle, args=(end,))
    waiting.start()
    began = time.process_time()
    with Sampling() as sampling:
        working = threading.Thread(target=busy, args=(0.3,))
        working.start()
        working.join()
    used = time.process_time() - began
    end.set()
    waiting.join()
    place = next(call for stack in sampling.seconds for call in stack if call.endswith(":busy")).partition(
        ":"
    )[0]
    found = by_stage(sampling.seconds, {"work": [f"{place}:busy"], "waiting": [f"{place}:idle"]})
    assert found["work"] == pytest.approx(0.3, abs=0.03)
    assert found["waiting"] < 0.01
    assert found["work"] + found[OTHER] <= used


def test_a_stack_belongs_to_its_innermost_stage():
    """A class stands for its methods, a function for those within it; names that only begin alike do not."""
    from sampling import OTHER, by_stage, collapsed

    seconds = {
        ("m:run", "m:Bone.fill"): 1.0,
        ("m:run", "m:Bone.fill", "m:run.<locals>.inner", "other:f"): 2.0,
        ("m:runs", "m:Bones"): 4.0,
    }
    assert by_stage(seconds, {"a": ["m:run"], "b": ["m:Bone"]}) == {"a": 2.0, "b": 1.0, OTHER: 4.0}
    assert collapsed(seconds).splitlines()[1] == "m:run;m:Bone.fill;m:run.<locals>.inner;other:f 2000"


def test_the_calls_of_all_stages_are_there():
    """What is renamed must be renamed there, too."""
    from run_stages import STAGES

    for call in (one for calls in STAGES.values() for one in calls if ":" in one and "frozen" not in one):
        module, _, name = call.partition(":")
        assert callable(attrgetter(name)(import_module(f"vtkmuscle.{module.replace('/', '.')}"))), call


def test_stages_of_a_run_sum_up_to_the_whole(tmp_path):
    """All that the process uses is in a stage, and nearly all of it in one with a name."""
    from run_stages import STAGES, rows, run_seconds
    from sampling import OTHER, by_stage

    scene = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=20).save(tmp_path / "scene")
    before = time.process_time()
    seconds = run_seconds(scene, tmp_path / "out", figures=False)
    used = time.process_time() - before
    found = by_stage(seconds, STAGES)
    assert list(found) == [*STAGES, OTHER]
    assert found.total() - before == pytest.approx(used, rel=0.1)
    assert found["steps"] > 0.0  # a shorter stage may end before it is looked at
    assert found[OTHER] < 0.2 * used
    assert rows(seconds)[-1][0] == "total"
    assert (tmp_path / "out" / "report.json").is_file()
