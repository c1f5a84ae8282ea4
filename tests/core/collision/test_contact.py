import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vtkmuscle.core.collision.contact import Barrier, Contact
from vtkmuscle.core.collision.obstacles import DistanceObstacle, VoxelObstacle


def box(low, high):
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))])
    return np.asarray(low) + corners * (np.asarray(high) - np.asarray(low)), triangles


def obstacle(kind, *where, bone=0, **settings):
    if kind == "voxel":
        return VoxelObstacle(bone, *box(*where), n_max=20**3, **settings)
    return DistanceObstacle(bone, *box(*where), **settings)


def contact_of(obstacles, x, *, now=None, before=None, free=None):
    n_bones = max(o.bone for o in obstacles) + 1
    still = np.broadcast_to(np.eye(4), (n_bones, 4, 4))
    free = np.ones(len(x), dtype=bool) if free is None else free
    barrier = Barrier(obstacles, x, np.zeros(3), free, bone_push=False)
    return Contact(barrier, still if now is None else now, still if before is None else before, x)


def with_far_ones(*points):
    """Return points, and as many and one more far away: a muscle that is not all in the bone."""
    return np.array([*points, *[[300.0, 300.0, 300.0]] * (len(points) + 1)], dtype=float)


def moved_by(translation):
    transform = np.eye(4)
    transform[:3, 3] = translation
    return transform


class Untouched(DistanceObstacle):
    """A bone that must not be looked at."""

    @property
    def axes(self):
        raise AssertionError("a far bone was looked at")

    def keep_out(self, *_, **__):
        raise AssertionError("a far bone was tested")


def test_far_bones_are_not_looked_at(rng):
    x = rng.uniform(-10, 10, (50, 3))
    far = [Untouched(k, *box([100 + 50 * k] * 3, [130 + 50 * k] * 3)) for k in range(4)]
    p = x + rng.normal(size=x.shape)
    before = p.copy()
    assert not contact_of(far, x).keep_out(p).any()
    assert np.array_equal(p, before)


@pytest.mark.parametrize("kind", ["sdf", "voxel"])
def test_fixed_points_are_not_tested_nor_do_they_bring_a_bone_near(kind):
    x = np.array([[0.0, 0.0, 20.0], [0.0, 0.0, 0.0]])  # the second is in the bone
    bone = obstacle(kind, [-5, -5, -5], [5, 5, 5])
    p = x.copy()
    hit = contact_of([bone], x, free=np.array([True, False])).keep_out(p)
    assert not hit.any()
    assert np.array_equal(p, x)
    assert not {"grid", "shape"} & set(vars(bone))


@pytest.mark.parametrize("kind", ["sdf", "voxel"])
def test_no_free_points_and_no_bones_are_fine(kind):
    x = np.zeros((3, 3))
    bone = obstacle(kind, [-5, -5, -5], [5, 5, 5])
    assert not contact_of([bone], x, free=np.zeros(3, dtype=bool)).keep_out(x.copy()).any()
    barrier = Barrier([], x, np.zeros(3), np.ones(3, dtype=bool), bone_push=False)
    still = np.eye(4)[None]
    assert not Contact(barrier, still, still, x).keep_out(x.copy()).any()


def test_a_bone_that_is_far_before_and_after_its_jump_but_not_between_takes_the_points_along():
    """What counts is the path seen from the bone, not where things are at the end of the step."""
    x = with_far_ones([0.0, 0.0, 0.0])
    bone = obstacle("sdf", [-105, -5, -5], [-95, 5, 5])
    now = np.array([moved_by([200.0, 0.0, 0.0])])
    p = x.copy()
    with pytest.warns(UserWarning, match="bone: it moved 200 mm .* but is 10 mm thick"):
        assert contact_of([bone], x, now=now).keep_out(p)[0]
    assert p[0, 0] == pytest.approx(105.0, abs=1e-2)


def test_a_point_that_flies_through_a_bone_is_told_from_a_bone_that_jumps():
    x = with_far_ones([-15.0, 0.0, 0.0])
    bone = obstacle("sdf", [-5, -5, -5], [5, 5, 5])
    p = x.copy()
    p[0, 0] = 15.0
    with pytest.warns(UserWarning, match="bone: a point of the muscle moved 30 mm .* by its own velocity"):
        assert contact_of([bone], x).keep_out(p)[0]
    assert p[0, 0] < 0.0


def test_a_point_pushed_out_of_one_bone_into_the_reach_of_the_next_is_tested_there():
    x = with_far_ones([-6.0, 0.0, 0.0], [-6.0, 1.0, 0.0])
    one = obstacle("sdf", [-5, -5, -5], [5, 5, 5])
    other = obstacle("sdf", [-40, -5, -5], [-4.5, 5, 5], bone=1)
    p = x + np.array([2.0, 0.0, 0.0])
    contact = contact_of([one, other], with_far_ones([-6.0, 9.0, 0.0], [-6.0, 9.0, 1.0]))
    contact.keep_out(p)
    assert other.shape.nbytes > 0


def test_a_turned_bone_is_met_exactly_where_it_is(rng):
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_euler("xyz", [20, 50, 70], degrees=True).as_matrix()
    turn[:3, 3] = [30.0, -10.0, 5.0]
    bone = obstacle("sdf", [-20, -3, -1], [20, 3, 1])
    rest = rng.uniform(60, 90, (4000, 3))  # beside the bone at rest
    p = rng.uniform(-22, 22, (4000, 3)) + turn[:3, 3]
    in_bone = np.abs((p - turn[:3, 3]) @ turn[:3, :3])
    inside, outside = (in_bone < [19.8, 2.8, 0.8]).all(axis=1), (in_bone > [20.1, 3.1, 1.1]).any(axis=1)
    barrier = Barrier([bone], rest, np.zeros(3), np.ones(len(p), dtype=bool), bone_push=False)
    hit = Contact(barrier, turn[None], turn[None], p.copy()).keep_out(p)
    assert inside.sum() > 5
    assert hit[inside].all()
    assert not hit[outside].any()


@pytest.mark.parametrize("skin", [0.0, 1.5, 4.0])
def test_a_skin_wider_than_the_usual_band_gets_a_grid_that_holds_it(skin):
    bone = obstacle("sdf", [-20, -20, -20], [20, 20, 20], skin=skin)
    x = with_far_ones([0.0, 0.0, 30.0])
    p = with_far_ones([0.0, 0.0, 19.0])
    assert contact_of([bone], x).keep_out(p)[0]
    assert p[0, 2] == pytest.approx(20.0 + skin, abs=1e-3)


def test_points_nearer_than_the_skin_at_rest_may_stay_as_near():
    bone = obstacle("sdf", [-20, -20, -20], [20, 20, 20], skin=2.0)
    x = with_far_ones([0.0, 0.0, 20.5])
    p = x.copy()
    assert not contact_of([bone], x).keep_out(p).any()
    p = with_far_ones([0.0, 0.0, 20.1])
    assert contact_of([bone], x).keep_out(p)[0]
    assert p[0, 2] == pytest.approx(20.5, abs=1e-2)
