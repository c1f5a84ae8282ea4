import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from shapes import ring

from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.pbd.voxels import INSIDE, VoxelGrid, build_voxel_grid, resolve_collisions

AT_REST = np.eye(4)


@pytest.fixture(scope="module")
def grid() -> VoxelGrid:
    return build_voxel_grid(*ring(), n_max=8000)


def crossing_segments(n=3000, seed=5, reach=16.0):
    """Return previous positions, half of them near, and predicted positions in and about the ring."""
    rng = np.random.default_rng(seed)
    p = rng.uniform(-13.0, 13.0, (n, 3)) * [1, 1, 0.25]
    near = p + rng.normal(size=(n, 3))
    return np.where(np.arange(n)[:, None] % 2 == 0, near, rng.uniform(-reach, reach, (n, 3))), p


def resolved(grid, x, p, *, now=AT_REST, step=AT_REST, free=None, bone_push=True):
    after = p.copy()
    free = np.ones(len(p), dtype=bool) if free is None else free
    moved = resolve_collisions(grid, now, step, x, after, free, bone_push=bone_push)
    return after, moved


def test_points_that_were_outside_end_outside_on_their_segment(grid):
    x, p = crossing_segments()
    after, moved = resolved(grid, x, p)
    was_outside = ~grid.contains(x)
    np.testing.assert_array_equal(moved, grid.contains(p))
    hit = moved & was_outside
    assert hit.sum() > 500
    assert not grid.contains(after[hit]).any()
    t = np.einsum("ij,ij->i", after[hit] - p[hit], x[hit] - p[hit]) / np.sum((x - p)[hit] ** 2, axis=1)
    assert ((t > 0) & (t <= 1 + 1e-12)).all()
    np.testing.assert_allclose(after[hit], p[hit] + t[:, None] * (x - p)[hit], atol=3e-6 * grid.spacing.max())


def test_the_walk_stops_at_the_first_outside_cell(grid):
    x, p = crossing_segments()
    after, moved = resolved(grid, x, p)
    hit = np.flatnonzero(moved & ~grid.contains(x))
    back_to_x = (after[hit] == x[hit]).all(axis=1)
    assert 20 < back_to_x.sum() < len(hit)
    for i, back in zip(hit, back_to_x, strict=True):
        walked = p[i] + np.linspace(0, 1 - 1e-6, 200)[:, None] * (after[i] - p[i])
        outside = walked[~grid.contains(walked)]
        # Only the cell of x itself may be outside; a point that was stopped is on the face of the cell.
        cells = np.floor((outside - grid.origin) / grid.spacing)
        assert (cells == np.floor((x[i] - grid.origin) / grid.spacing)).all() if back else not len(outside)


def test_points_that_were_in_the_bone_move_with_it(grid):
    x, p = crossing_segments()
    step = np.eye(4)
    step[:3, :3] = Rotation.from_rotvec([0.02, -0.01, 0.03]).as_matrix()
    step[:3, 3] = [0.3, 0.2, -0.1]
    after, moved = resolved(grid, x, p, step=step)
    pushed = grid.contains(x) & grid.contains(p)
    assert pushed.sum() > 50
    np.testing.assert_allclose(after[pushed], apply_transform(step, x[pushed]), atol=1e-12)
    left, moved_without = resolved(grid, x, p, step=step, bone_push=False)
    np.testing.assert_array_equal(left[pushed], p[pushed])
    np.testing.assert_array_equal(moved_without, moved & ~pushed)
    np.testing.assert_array_equal(left[~pushed], after[~pushed])


def test_points_that_do_not_end_in_the_bone_or_are_not_free_stay(grid):
    x, p = crossing_segments()
    free = np.arange(len(p)) % 2 == 0
    after, moved = resolved(grid, x, p, free=free)
    stay = ~free | ~grid.contains(p)
    assert not moved[stay].any()
    np.testing.assert_array_equal(after[stay], p[stay])


@given(st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6))
@settings(deadline=None, max_examples=20)
def test_a_moved_bone_treats_points_moved_with_it_alike(motion):
    grid = build_voxel_grid(*ring(), n_max=8000)
    x, p = crossing_segments(n=500)
    now = np.eye(4)
    now[:3, :3] = Rotation.from_rotvec(motion[:3]).as_matrix()
    now[:3, 3] = np.multiply(motion[3:], 50.0)
    expected, expected_moved = resolved(grid, x, p)
    after, moved = resolved(grid, apply_transform(now, x), apply_transform(now, p), now=now)
    # Rounding may put a point that is on a cell's face into the neighbouring cell.
    same = np.abs(after - apply_transform(now, expected)).max(axis=1) < 1e-6
    assert same.mean() > 0.995
    assert (moved == expected_moved).mean() > 0.995


def test_extreme_segments_end_and_stay_finite(grid):
    centre = np.array([10.0, 0.0, 0.0])
    starts = np.array(
        [centre, centre + 1e9, -1e300 * np.ones(3), centre + np.array([1e-300, 0, 0]), [0.0, 0.0, 0.0]]
    )
    ends = np.tile(centre, (len(starts), 1))
    after, moved = resolved(grid, starts, ends)
    assert moved.all()
    assert np.isfinite(after).all()
    assert not grid.contains(after[[1, 2, 4]]).any()
    np.testing.assert_array_equal(after[0], centre)
    corners = grid.origin + np.outer([0.0, 1.0], grid.spacing * grid.cells.shape)
    untouched, none = resolved(grid, corners, corners)
    np.testing.assert_array_equal(untouched, corners)
    assert not none.any()


def test_segments_along_cell_faces_and_edges_end_outside(grid):
    inside = np.argwhere(grid.cells == INSIDE)
    p = grid.origin + grid.spacing * inside  # on corners of cells
    for direction in [(1, 0, 0), (0, -1, 0), (1, 1, 0), (-1, 1, 1), (1, -1, -1)]:
        x = p + 200 * grid.spacing * direction
        after, moved = resolved(grid, x, p)
        assert moved.all()
        assert not grid.contains(after).any()
