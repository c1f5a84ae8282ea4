"""P21's reported failure: the iliacus is drawn into the hip joint (its section 5 and Fig. 10)."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

BENCHMARK = Path(__file__).resolve().parents[2] / "benchmarks" / "bench_penetration.py"


@pytest.mark.realdata
def test_the_iliacus_stays_out_of_the_joint(lhdl_hip):
    """Over 90 degrees of flexion: free points within the acetabulum, with the defaults and without bones."""
    benchmark = runpy.run_path(str(BENCHMARK))
    scene, distances = benchmark["hip"](lhdl_hip)
    acetabulum = benchmark["Acetabulum"](scene)
    assert acetabulum.radius == pytest.approx(23.2, abs=0.5)
    joint = {}
    for collision in ("sdf", "none"):
        settings = {"collision": collision}
        frames = benchmark["measured"](scene, "iliacus", distances, settings, acetabulum)
        joint[collision] = np.array([depth for _, depth, _ in frames])
        assert (joint[collision][0] > 0).sum() <= 1  # at rest
    within = {collision: (depth > 0).sum(axis=1).max() for collision, depth in joint.items()}
    # Measured: 39 points, 1.06 mm deep, of 104 points, 3.95 mm where no bone keeps them out.
    assert within["sdf"] < 0.6 * within["none"]
    assert joint["sdf"].max() < 1.5
    assert joint["none"].max() > 3.0
