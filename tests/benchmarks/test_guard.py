"""Regressions are caught by counts and by ratios within a process, never by the clock."""

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
def test_figures_and_page_take_no_more_than_committed(guard, renders):
    """Windows, pictures, triangles, pixels, coarser bones and regressions, whatever the machine."""
    import work_counts

    committed = json.loads(guard.COMMITTED.read_text(encoding="utf-8"))
    now = work_counts.drawing()
    assert set(now) == DRAWN
    assert guard.regressions({"counts": now}, committed) == []
