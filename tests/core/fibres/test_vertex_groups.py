"""Vertices in groups: a tree that covers all of them, and means over its groups."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation
from spindle import spindle

from vtkmuscle.core.fibres.vertex_groups import vertex_groups


@pytest.fixture(scope="module")
def points():
    return spindle()[0]


def members(groups, part):
    return [-1 - part] if part < 0 else sorted(groups.order[groups.first[part] : groups.last[part]])


def test_each_group_is_made_of_two_and_the_first_is_all(points):
    groups = vertex_groups(points)
    assert len(groups.first) == len(points) - 1
    assert members(groups, 0) == list(range(len(points)))
    for group, (one, two) in enumerate(groups.parts):
        halves = members(groups, one), members(groups, two)
        assert sorted(halves[0] + halves[1]) == members(groups, group)
        assert 0 <= len(halves[0]) - len(halves[1]) <= 1


def test_means_and_radii_are_those_of_the_members(points):
    groups = vertex_groups(points)
    values = np.random.default_rng(0).normal(size=points.shape)
    means, centres = groups.with_means(values), groups.with_means(points)
    assert_array_equal(means[: len(points)], values)
    assert groups.sizes[: len(points)].max() == 1
    for group in range(len(groups.first)):
        ids, row = members(groups, group), len(points) + group
        assert groups.sizes[row] == len(ids)
        assert_allclose(means[row], values[ids].mean(axis=0), atol=1e-12)
        farthest = np.linalg.norm(points[ids] - centres[row], axis=1).max()
        assert groups.radii[group] == pytest.approx(farthest, rel=1e-9, abs=1e-9)


def test_groups_are_compact(points):
    groups = vertex_groups(points)
    sizes = groups.last - groups.first
    random = np.random.default_rng(1).permutation(len(points))[:32]
    scattered = np.linalg.norm(points[random] - points[random].mean(axis=0), axis=1).max()
    assert np.median(groups.radii[(sizes > 16) & (sizes <= 32)]) < 0.35 * scattered


def test_a_turned_mesh_has_the_same_groups(points):
    turned = Rotation.from_rotvec([0.3, -1.1, 0.7]).apply(points) + np.array([1e3, -2e3, 50.0])
    assert_array_equal(vertex_groups(turned).order, vertex_groups(points).order)
    assert_array_equal(vertex_groups(turned).parts, vertex_groups(points).parts)


@pytest.mark.parametrize("points", [np.zeros((1, 3)), np.zeros((5, 3)), np.eye(3)[:2]])
def test_few_or_equal_points(points):
    groups = vertex_groups(points)
    assert sorted(groups.order) == list(range(len(points)))
    assert_allclose(groups.with_means(points)[len(points) :].min(initial=0.0), 0.0)
