"""P21's reported failure: the iliacus is drawn into the hip joint (its section 5 and Fig. 10)."""

import runpy
from pathlib import Path

import numpy as np
import pytest

BENCHMARK = Path(__file__).resolve().parents[2] / "benchmarks" / "bench_penetration.py"


#: P21's own way: Algorithm 2 with voxels.
P21 = {"deformer": "pbd", "quality": "published"}


@pytest.fixture
def joint(lhdl_hip):
    """Return what yields, per frame of 90 degrees of flexion, the depth of points in the acetabulum [mm]."""
    benchmark = runpy.run_path(str(BENCHMARK))
    scene, distances = benchmark["hip"](lhdl_hip)
    acetabulum = benchmark["Acetabulum"](scene)
    assert acetabulum.radius == pytest.approx(23.2, abs=0.5)

    def depths(settings):
        frames = benchmark["measured"](scene, "iliacus", distances, settings, acetabulum)
        for number, (_, depth, _) in enumerate(frames):
            assert number or (depth > 0).sum() <= 1  # at rest
            yield depth

    return depths


@pytest.mark.realdata
@pytest.mark.gap("points of the iliacus in the hip joint, without a joint capsule", "14 points", "1 point")
@pytest.mark.gap("depth of the iliacus in the hip joint, without a joint capsule", "0.61 mm", "0.5 mm")
@pytest.mark.slow
def test_the_iliacus_hardly_enters_the_joint(joint):
    """Paths stay out of the bones, not out of the gap between head and socket."""
    for depths in joint({}):
        assert (depths > 0).sum() <= 18
        assert depths.max() < 0.7


@pytest.mark.realdata
@pytest.mark.long
def test_p21s_settings_draw_it_in(joint):
    """Measured: 192 points, 3.9 mm deep."""
    assert np.max(list(joint(P21))) > 3.0
