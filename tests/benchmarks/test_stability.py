"""Position based dynamics of a real muscle in the worst of the cases of bench_pbd.py."""

import pytest


@pytest.mark.realdata
def test_a_large_step_in_a_single_iteration_folds_few_edges(benchmarks, lhdl_hip):
    from bench_pbd import Hip, worst_of

    worst, _ = worst_of(Hip(), "iliacus", "3000", 45, 1, fibres=True, bones=True)
    volume, stretch, _, folds, _ = worst
    assert volume < 1e-6
    assert stretch < 12
    assert folds <= 12
