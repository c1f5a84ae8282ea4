"""Sheets that go round on an edge of a bone are at rest; sheets on their way are not."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from vtkmuscle import Scene
from vtkmuscle.core.paths.pose import CYCLE, goes_round
from vtkmuscle.data.arrays import field_array
from vtkmuscle.run.muscles import muscle_pipeline

RATTLE = 1e-3


def sheet(move):
    """Return a sheet of which a point is moved."""
    x = np.zeros((2, 5, 3))
    x[1, 2] = move
    return x


@given(period=st.integers(2, CYCLE - 1), part=st.floats(0.01, 0.5))
def test_a_small_cycle_is_rest_and_a_large_one_is_not(period, part):
    turns = 2.0 * np.pi * np.arange(CYCLE + 1) / period
    for radius, at_rest in ((part * RATTLE, True), (3.0 * RATTLE, False)):
        *recent, x = (sheet((radius * np.cos(turn), radius * np.sin(turn), 0.0)) for turn in turns)
        assert goes_round(x, recent, RATTLE) == at_rest


@given(ratio=st.floats(0.0, 1.0), size=st.floats(1e-12, 1.0))
@example(ratio=1.0, size=5e-5)
@example(ratio=0.97, size=8e-5)
def test_of_a_sheet_on_its_way_less_than_the_rattle_is_left(ratio, size):
    steps = size * ratio ** np.arange(CYCLE + 1.0)
    *recent, x = (sheet((way, 0.0, 0.0)) for way in np.cumsum(steps))
    if goes_round(x, recent, RATTLE):
        left = steps[-1] * ratio / (1.0 - ratio) if ratio < 1.0 else np.inf
        assert left < RATTLE


@pytest.mark.realdata
@pytest.mark.slow
def test_an_infraspinatus_on_the_spine_of_its_scapula_comes_to_rest(bp3d_arm):
    scene = Scene.load(bp3d_arm / "shoulder_abduction.toml")
    paths = muscle_pipeline(scene, "infraspinatus").taut_paths
    for time in scene.motion.times[:16:5]:
        assert not field_array(paths.update(time=float(time)).output, "Unsettled")[0]
