"""The fit of the linear blend of the papers, against blends that are made for it."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

from vtkmuscle.core.motion.blending import blend_fibres

FOLDER = Path(__file__).parents[2] / "benchmarks" / "paper"


@pytest.fixture
def fitted_a():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", [str(FOLDER), *sys.path])
        yield importlib.import_module("linear_blend_fit").fitted_a


def test_a_is_found_where_the_fibres_stay_out_of_a_bone(fitted_a):
    # Fibres along x; the insertion's bone lifts by 10 mm, and a bone below y = 10 (1 - w) - 1 is not entered
    # by the blend with a = 0.4 but by all with a larger one.
    t = np.linspace(0, 1, 31)
    points = np.column_stack([100 * t, 0 * t, 0 * t])
    offsets = np.array([0, 31])
    lift = np.eye(4)
    lift[1, 3] = 10.0
    floor = blend_fibres(points, offsets, np.eye(4), lift, 0.4)[:, 1]

    def depth(pose, moved):
        assert pose == 0
        return np.maximum(floor - moved[:, 1], 0.0)

    a, left = fitted_a(points, offsets, [(np.eye(4), lift)], depth)
    assert a == pytest.approx(0.4, abs=0.01)
    assert left == pytest.approx(0.0, abs=1e-3)
    assert fitted_a(points, offsets, [(np.eye(4), lift)], lambda _, moved: np.zeros(31)) == (0.0, 0.0)


@pytest.mark.parametrize("largest", [1.0, 0.3])
def test_where_no_a_is_best_the_fit_ends_at_its_bound(fitted_a, largest):
    # The insertion's bone lifts all into a ceiling: the less of it a fibre follows, the better.
    points = np.column_stack([np.linspace(0, 100, 31), np.zeros((31, 2))])
    lift = np.eye(4)
    lift[1, 3] = 10.0
    for sign, pose in ((-1.0, (np.eye(4), lift)), (1.0, (lift, np.eye(4)))):
        a, left = fitted_a(points, np.array([0, 31]), [pose], lambda _, moved: moved[:, 1], largest=largest)
        assert a == sign * largest
        others = [
            blend_fibres(points, np.array([0, 31]), *pose, sign * smaller)[:, 1].mean()
            for smaller in np.linspace(0, largest, 5)
        ]
        assert others[-1] == pytest.approx(left)
        assert (np.diff(others) < 0).all()
