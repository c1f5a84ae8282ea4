import numpy as np
import pytest
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
    return after, resolve_collisions(grid, now, step, x, after, free, bone_push=bone_push)


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


def test_extreme_segments_end_and_stay_finite(grid):
    centre = np.array([10.0, 0.0, 0.0])
    starts = np.array(
        [centre, centre + 1e9, -1e300 * np.ones(3), centre + np.array([1e-300, 0, 0]), [0.0, 0.0, 0.0]]
    )
    after, moved = resolved(grid, starts, np.tile(centre, (len(starts), 1)))
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
