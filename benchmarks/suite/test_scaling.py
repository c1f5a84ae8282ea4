"""How time grows: with triangles, fibres, bones and frames.

``scale`` and ``size`` of the ``extra_info`` say of what and at which size.
"""

from __future__ import annotations

import pytest
from problems import settling_of, steps_of

ROUNDS, FEW = 15, 2
#: Steps take longer than an iteration by far.
LARGEST_STEP = 100_000


@pytest.fixture
def within(request):
    """Leave out what is larger than was asked for."""

    def check(triangles):
        largest = request.config.getoption("largest")
        if triangles > largest:
            pytest.skip(f"larger than --largest {largest}")

    return check


@pytest.mark.parametrize("triangles", [1_000, 10_000, 100_000, 1_000_000])
def test_settling(measured, within, triangles):
    within(triangles)
    measured(settling_of(triangles), rounds=ROUNDS, scale="triangles, an iteration", size=triangles)


@pytest.mark.parametrize("triangles", [1_000, 10_000, LARGEST_STEP])
def test_steps(measured, within, triangles):
    within(triangles)
    measured(steps_of(triangles), rounds=FEW, scale="triangles, two steps from nothing", size=triangles)


@pytest.mark.parametrize("n_fibres", [10, 100, 1_000, 10_000])
def test_fibres(measured, within, hip, n_fibres):
    within(10 * n_fibres)
    measured(lambda: hip.fibres(n_fibres), rounds=FEW, scale="fibres", size=n_fibres)


@pytest.mark.parametrize("n_bones", [2, 10, 50])
def test_bones_far_away(measured, hip, n_bones):
    measured(lambda: hip.frames(5, n_far=n_bones - 2), rounds=FEW, scale="bones far away", size=n_bones)


@pytest.mark.parametrize("frames", [5, 40])
def test_frames(measured, hip, frames):
    measured(lambda: hip.frames(frames), rounds=FEW, scale="frames", size=frames)
