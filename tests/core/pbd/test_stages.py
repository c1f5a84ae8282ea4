"""Time by stage: all of it, once."""

import time

import numpy as np
import pytest
from spindle import spindle

from vtkmuscle.core.motion.rigid import rotation_about
from vtkmuscle.core.pbd.parameters import SolverParameters
from vtkmuscle.core.pbd.solver import MuscleSolver
from vtkmuscle.core.pbd.stages import STAGES, StageClock, add_stages


def test_the_stages_add_up_to_the_time_that_went_by():
    before = time.perf_counter()
    clock = StageClock("prediction")
    began = time.perf_counter()
    for stage in ("constraints", "collision", "constraints", "settling"):
        clock.switch(stage)
    done = time.perf_counter()
    spent = clock.stop()
    after = time.perf_counter()
    assert tuple(spent) == STAGES
    assert spent["acceleration"] == 0.0
    assert 1e3 * (done - began) <= sum(spent.values()) <= 1e3 * (after - before)


def test_sums_are_by_stage():
    one, other = dict.fromkeys(STAGES, 1.0), {"collision": 2.0}
    assert add_stages(one, other) == {**one, "collision": 3.0}


@pytest.mark.parametrize("solver", ["gauss-seidel", "anderson"])
def test_a_step_tells_what_its_time_went_to(solver):
    points, triangles, fixed_to = spindle()
    muscle = MuscleSolver(points, triangles, fixed_to, SolverParameters(solver=solver, substeps=2))
    now = np.array([np.eye(4), rotation_about([0, 20, 0], [1, 0, 0], 10.0)])
    began = time.perf_counter()
    state = muscle.step(muscle.rest_state(2), now)
    took = 1e3 * (time.perf_counter() - began)
    spent = state.milliseconds
    assert sum(spent.values()) <= took
    assert all(spent[stage] > 0.0 for stage in STAGES)
