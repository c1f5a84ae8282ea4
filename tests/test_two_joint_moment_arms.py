"""A strap over two joints has the moment arms of the rollers that it runs round, about both of them."""

import tomllib

import numpy as np
import pytest
import tomli_w
from two_joint_scene import JOINTS, save_strap

from vtkmuscle import Scene
from vtkmuscle.phantoms.two_joint_strap import ARMS


@pytest.fixture(scope="module")
def arms(tmp_path_factory):
    """Moment arms over 90 degrees of each joint, of 100 fibres of 30 segments."""
    path = save_strap(tmp_path_factory.mktemp("strap"), n_fibres=100, resolution=30)
    tables = tomllib.loads(path.read_text())
    # The rest pose is in the middle of the upper joint's range: its 90 degrees are those from -40 on.
    grid = {"upper": [-40, 50, 10], "lower": [0, 90, 10]}
    tables |= {"joints": JOINTS, "motion": {"grid": grid}, "model": "paths"}
    path.write_text(tomli_w.dumps(tables))
    with pytest.warns(UserWarning, match="from rest to the first frame"):
        result = Scene.load(path).run()
    return result.moment_arms()["strap"]


@pytest.mark.parametrize(("name", "known"), [("upper", ARMS[0]), ("lower", -ARMS[1])])
def test_moment_arms_are_within_three_per_cent_over_the_grid(arms, name, known):
    found = arms[name].mean
    assert len(found) == 100
    np.testing.assert_allclose(found, known, rtol=0.03)
