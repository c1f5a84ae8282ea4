"""A strap over two joints has the moment arms of the rollers that it runs round, about both of them."""

import tomllib

import numpy as np
import pytest
import tomli_w
from phantoms.two_joint_strap import ARMS
from two_joint_scene import JOINTS, save_strap

from vtkmuscle import Scene


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """Paths over 90 degrees of each joint, of 36 fibres of 30 segments."""
    path = save_strap(tmp_path_factory.mktemp("strap"), n_fibres=36, resolution=30)
    tables = tomllib.loads(path.read_text())
    # The rest pose is in the middle of the upper joint's range: its 90 degrees are those from -40 on.
    grid = {"upper": [-40, 50, 15], "lower": [0, 90, 15]}
    tables |= {"joints": JOINTS, "motion": {"grid": grid}, "deformer": "none"}
    path.write_text(tomli_w.dumps(tables))
    return Scene.load(path).run()


@pytest.fixture(scope="module")
def arms(result):
    return result.moment_arms()["strap"]


@pytest.mark.parametrize(("name", "known", "bound"), [("upper", ARMS[0], 0.02), ("lower", -ARMS[1], 0.02)])
def test_moment_arms_are_those_of_the_rollers_in_every_pose_of_the_grid(arms, result, name, known, bound):
    """A path's corners are on the roller, 1 % of which are facets, and between them are chords."""
    found, radius = arms[name].mean, abs(known)
    segment = result.lengths["strap"].max() / (result.paths("strap", frame=0).points.shape[1] - 1)
    chord = radius * (1.0 - np.cos(segment / (2.0 * radius)))
    assert len(found) == 49
    np.testing.assert_allclose(found, known, atol=chord + 0.01 * radius)
    np.testing.assert_allclose(found.mean(), known, rtol=bound)


@pytest.mark.parametrize("name", ["upper", "lower"])
def test_the_pose_of_a_row_is_known_by_its_frame(result, name):
    """Rows had the value of the own coordinate alone: seven rows of a grid were the same pose."""
    poses, rows = result.pose_table(), result.moment_arms().summary().where(coordinate=name)
    np.testing.assert_array_equal(poses[name][rows["frame"]], rows["value"])
    assert len({*zip(poses["upper"], poses["lower"], strict=True)}) == len(rows["frame"]) == 49


@pytest.mark.parametrize("name", ["upper", "lower"])
def test_slopes_of_the_lengths_are_the_moment_arms(arms, name):
    """On the mean of 49 poses; single ones differ by steps of 15 degrees, and as points come to bones."""
    assert arms[name].mean_slope.mean() == pytest.approx(arms[name].mean.mean(), abs=0.1)
    assert np.sqrt(((arms[name].mean_slope - arms[name].mean) ** 2).mean()) < 0.5
