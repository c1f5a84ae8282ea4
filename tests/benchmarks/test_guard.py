"""Regressions are caught by counts and by ratios within a process, never by the clock."""

from __future__ import annotations

import json

import pytest

#: What is counted of figures and page.
DRAWN = {
    "bones made coarser",
    "pictures",
    "moment arms of muscles",
    "thousands of pixels drawn",
    "triangles drawn",
    "windows opened",
}


@pytest.fixture(scope="module")
def work():
    """How often what is done in a run."""
    import work_counts

    return work_counts.work()


@pytest.fixture
def guard():
    """The guard of the benchmarks."""
    import guard

    return guard


def test_work_and_memory_are_no_more_than_committed(guard, work):
    """Projections, collision passes and executions per run, and bytes per point, whatever the machine."""
    from fibre_counts import fibre_work
    from work_counts import memory

    committed = json.loads(guard.COMMITTED.read_text(encoding="utf-8"))
    now = {**work, **fibre_work(), "bytes per point of a step": memory()}
    assert guard.regressions({"counts": now}, committed) == []
    assert {*now, *DRAWN} == set(committed["counts"]), "run benchmarks/guard.py --update"


@pytest.mark.slow
def test_figures_and_page_take_no_more_than_committed(guard, monkeypatch):
    """Windows, pictures, triangles, pixels, coarser bones and regressions, whatever the machine."""
    import work_counts

    from vtkmuscle.plotting import Studio, can_render

    if (reason := can_render()) is not None:
        pytest.skip(reason)
    committed = json.loads(guard.COMMITTED.read_text(encoding="utf-8"))
    now = work_counts.drawing()
    assert set(now) == DRAWN
    assert guard.regressions({"counts": now}, committed) == []
    picture = Studio.picture  # a window for each picture is told
    monkeypatch.setattr(Studio, "picture", lambda self, *a, **k: [picture(Studio(), *a, **k), self][0])
    told = [line.split(":")[0] for line in guard.regressions({"counts": work_counts.drawing()}, committed)]
    assert told == ["windows opened"]


def test_a_regression_is_told(guard):
    before = {
        "ratios": {"step": 2.0},
        "counts": {"projections": 10, "bytes per point": 100},
    }
    same = {
        "ratios": {"step": 2.2, "new": 9.0},
        "counts": {"projections": 10, "bytes per point": 124},
    }
    assert guard.regressions(same, before) == []
    worse = {
        "ratios": {"step": 2.4},
        "counts": {"projections": 11, "bytes per point": 126},
    }
    told = guard.regressions(worse, before)
    assert [line.split(":")[0] for line in told] == ["step", "projections", "bytes per point"]


def test_one_more_settling_per_frame_is_counted(guard, work, monkeypatch):
    """Plant what the guard is there for: a step that does its work twice."""
    import work_counts

    from vtkmuscle.core.skinning.settling import Settling

    settle = Settling.settle

    def twice(self, *arguments, **keywords):
        settle(self, *arguments, **keywords)
        return settle(self, *arguments, **keywords)

    monkeypatch.setattr(Settling, "settle", twice)
    now = work_counts.work()
    assert now["diffusions"] == 2 * work["diffusions"]
    assert guard.regressions({"counts": now}, {"counts": work})
