"""The processor time of a run is all of it in the stages, and in those that use it."""

from __future__ import annotations

import sys
import time
from importlib import import_module
from operator import attrgetter

import pytest

from vtkmuscle import Scene, phantoms

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has clocks of other threads")


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
