"""Position based dynamics of real muscles in cases of bench_pbd.py that were beyond the bounds."""

import pytest

ARM, HIP = "bp3d_arm/shoulder_abduction.toml", "lhdl_hip/scene.toml"


@pytest.mark.realdata
@pytest.mark.parametrize("fibres", [True, False])
@pytest.mark.parametrize(
    ("scene", "muscle", "mesh", "step", "iterations", "bones"),
    [(HIP, "iliacus", "3000", 22, 1, True), (ARM, "supraspinatus", None, 1, 10, False)],
)
def test_no_edge_is_long(benchmarks, lhdl_hip, scene, muscle, mesh, step, iterations, bones, fibres):
    from bench_pbd import Muscles, worst_of

    case = Muscles(lhdl_hip.parent / scene), muscle, mesh, step, iterations
    volume, stretch, _, folds, _ = worst_of(*case, fibres=fibres, bones=bones)[0]
    assert volume < 1e-6
    assert stretch < 12
    assert folds <= 12
