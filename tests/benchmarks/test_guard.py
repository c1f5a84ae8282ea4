"""Regressions are caught by counts and by ratios within a process, never by the clock."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def guard():
    """The guard of the benchmarks."""
    if not FOLDER.is_dir():
        pytest.skip("the benchmarks are not here")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", [str(FOLDER), *sys.path])
        import guard

        yield guard


def test_work_and_memory_are_no_more_than_committed(guard):
    """Projections, collision passes and executions per run, and bytes per point, whatever the machine."""
    committed = json.loads(guard.COMMITTED.read_text(encoding="utf-8"))
    now = guard.counts()
    assert guard.regressions({"counts": now}, committed) == []
    assert set(now) == set(committed["counts"]), "run benchmarks/guard.py --update"


def test_an_iteration_is_faster_than_the_naive_one(guard):
    """4.1 times were measured; a machine that does other things is left a margin of 2."""
    times = guard.interleaved(
        {"naive": guard.naive_iteration_of(20_000), "fast": guard.iteration_of(20_000)}, rounds=15
    )
    assert times["naive"] > 2.0 * times["fast"]


def test_time_of_an_iteration_grows_with_the_triangles(guard):
    assert guard.power({n: guard.iteration_of(n) for n in (5_000, 50_000)}, 15) < 1.3


def test_a_regression_is_told(guard):
    before = {
        "ratios": {"kernel": 2.0},
        "scaling": {"triangles": 1.0, "gain of two": 1.8},
        "counts": {"projections": 10, "bytes per point": 100},
    }
    same = {
        "ratios": {"kernel": 2.9, "new": 9.0},
        "scaling": {"triangles": 1.2, "gain of two": 1.3},
        "counts": {"projections": 10, "bytes per point": 124},
    }
    assert guard.regressions(same, before) == []
    worse = {
        "ratios": {"kernel": 3.1},
        "scaling": {"triangles": 1.3, "gain of two": 1.1},
        "counts": {"projections": 11, "bytes per point": 126},
    }
    told = guard.regressions(worse, before)
    assert [line.split(":")[0] for line in told] == [
        "kernel",
        "triangles",
        "gain of two",
        "projections",
        "bytes per point",
    ]


def test_one_more_projection_per_iteration_is_counted(guard, monkeypatch):
    """Plant what the guard is there for: a step that does its work twice."""
    from vtkmuscle.core.solver import MuscleSolver

    before = guard.counts()["projections"]
    step = MuscleSolver.step

    def twice(self, *arguments, **keywords):
        step(self, *arguments, **keywords)
        return step(self, *arguments, **keywords)

    monkeypatch.setattr(MuscleSolver, "step", twice)
    now = guard.counts()
    assert now["projections"] == 2 * before
    assert guard.regressions({"counts": now}, {"counts": {"projections": before}})
