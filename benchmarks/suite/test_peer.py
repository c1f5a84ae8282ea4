"""pypbd's iteration beside ours: distance and bending, no volume, one thread; ``--pypbd PYTHON``.

pypbd is run by a Python of its own, in a process beside this one; ours is measured right before and after.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from bench_kernels import edges_of
from problems import held_torus

TRIANGLES, ROUNDS = 17_000, 30


def test_distance_and_bending(measured, benchmark, request, tmp_path):
    points, mass, topology, moved = held_torus(TRIANGLES)
    measured(edges_of(topology, points, mass, moved), rounds=ROUNDS)
    python = request.config.getoption("pypbd")
    if python is None:
        pytest.skip("--pypbd was not given; ours was measured")
    mesh = tmp_path / "mesh.npz"
    np.savez(mesh, points=points, triangles=topology.triangles, mass=mass, moved=moved)
    done = subprocess.run(
        [python, Path(__file__).parents[1] / "pypbd_iteration.py", mesh],
        check=True,
        capture_output=True,
        text=True,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )
    theirs = float(done.stdout.split()[-1])
    if benchmark.stats is not None:
        benchmark.extra_info["pypbd / ours"] = theirs / benchmark.stats.stats.min
