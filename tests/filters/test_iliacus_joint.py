"""P21's reported failure: the iliacus is drawn into the hip joint (its section 5 and Fig. 10)."""

from __future__ import annotations

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
@pytest.mark.xfail(
    strict=True,
    reason="pulled taut, the iliacus sinks into the gap of the joint, which a capsule fills that no scene "
    "has: up to 18 points in the first 40 degrees, where the chord of its ends kept it away",
)
def test_the_iliacus_stays_out_of_the_joint(joint):
    # Measured: 18 points, 0.90 mm deep. Wanted: the one point that is there at rest, 0.21 mm deep. Strings
    # are kept off the bones, not out of the gap between head and socket: from 2 to 40 degrees they carry the
    # surface a little over the socket's rim.
    for depths in joint({}):  # frame by frame: the first that fails is enough
        assert (depths > 0).sum() <= 1
        assert depths.max() < 0.5


@pytest.mark.realdata
@pytest.mark.long
def test_p21s_settings_draw_it_in(joint):
    """Measured: 192 points, 3.9 mm deep."""
    assert np.max(list(joint(P21))) > 3.0
