"""Position based dynamics of real muscles in cases of bench_pbd.py that were beyond the bounds."""

import pytest


@pytest.mark.realdata
@pytest.mark.parametrize(
    ("scene", "muscle", "mesh", "step", "settings"),
    [
        # A large step in one iteration, and angles whose corners moved by the whole turn, not by its chord.
        ("lhdl_hip/scene.toml", "iliacus", "3000", 22, {"iterations": 1, "fibres": True, "bones": True}),
        ("lhdl_hip/scene.toml", "iliacus", "3000", 22, {"iterations": 1, "fibres": False, "bones": True}),
        ("bp3d_arm/shoulder_abduction.toml", "supraspinatus", None, 1,
         {"iterations": 10, "fibres": True, "bones": False}),
    ],
)  # fmt: skip
def test_no_edge_is_long_and_few_are_folded(benchmarks, lhdl_hip, scene, muscle, mesh, step, settings):
    from bench_pbd import Muscles, worst_of

    worst, _ = worst_of(Muscles(lhdl_hip.parent / scene), muscle, mesh, step, **settings)
    volume, stretch, _, folds, _ = worst
    assert volume < 1e-6
    assert stretch < 12
    assert folds <= 12
