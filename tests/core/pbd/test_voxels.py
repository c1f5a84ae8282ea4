import numpy as np
import pytest
from oracles import igl
from scipy.ndimage import binary_dilation, label
from shapes import ball, box, ring, union
from slow import slow

from vtkmuscle.core.mesh.solids import closed_shells
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.pbd.voxels import BOUNDARY, DEFAULT_N_MAX, INSIDE, OUTSIDE, build_voxel_grid
from vtkmuscle.data.arrays import checked_surface
from vtkmuscle.io import read_polydata


def test_a_hollow_in_a_bone_counts_as_bone_whichever_way_it_faces():
    hollow = ball(radius=5.0)
    for inner in (hollow, (hollow[0], hollow[1][:, ::-1])):
        grid = build_voxel_grid(*union(ball(radius=10.0), inner), n_max=30_000)
        assert grid.contains(np.zeros((1, 3))).all()
        assert grid.cells[tuple(np.array(grid.cells.shape) // 2)] == INSIDE


@pytest.mark.parametrize("settings", [{}, {"n_equal": 64}], ids=["default", "equal"])
@pytest.mark.parametrize("shape", [ball(), box(), ring()], ids=["ball", "box", "ring"])
def test_the_volume_is_that_of_the_bone_and_half_a_boundary_layer_within_5_percent(shape, settings):
    assert_volume(build_voxel_grid(*shape, **settings), signed_volume(*shape))


def assert_volume(grid, volume):
    """All that counts as bone is too large by half the boundary; a byte holds a cell."""
    cell = grid.spacing.prod()
    half_a_layer = 0.5 * cell * (grid.cells == BOUNDARY).sum()
    assert cell * (grid.cells != OUTSIDE).sum() == pytest.approx(volume + half_a_layer, abs=0.05 * volume)
    assert grid.cells.nbytes == grid.cells.size


def read_bone(folder, bone):
    return checked_surface(read_polydata(folder / "bones" / f"{bone}.vtp"), bone)


@pytest.mark.realdata
@pytest.mark.parametrize("bone", [*slow("pelvis"), "femur_r"])
def test_voxels_of_real_bones_miss_nothing_and_fill_nothing_but_pockets(lhdl_hip, bone):
    """The pelvis has 21 tunnels, of which a few are as narrow as a cell: what is left of them is cut off."""
    points, triangles = read_bone(lhdl_hip, bone)
    grid = build_voxel_grid(points, triangles)
    surface = closed_shells(points, triangles)
    assert_volume(grid, sum(signed_volume(surface.points, shell) for shell in surface.shells))
    index = np.argwhere(grid.cells != BOUNDARY)
    # Those next to the boundary, where mistakes are made, and a sample of the others.
    near = binary_dilation(grid.cells == BOUNDARY, iterations=2)[tuple(index.T)]
    chosen = index[near | (np.arange(len(index)) % 50 == 0)]
    centres = grid.origin + grid.spacing * (chosen + 0.5)
    winding = [igl.fast_winding_number(surface.points, shell, centres) for shell in surface.shells]
    codes = grid.cells[tuple(chosen.T)]
    solid = np.max(winding, axis=0) > 0.5
    assert (codes[solid] == INSIDE).all()
    # What else is inside are cells of which no way leads out, but round the boundary through faces.
    rooms, _ = label(grid.cells != BOUNDARY)
    assert np.array_equal(grid.cells == OUTSIDE, rooms == rooms[0, 0, 0])
    assert (codes[~solid] == INSIDE).sum() <= 3e-4 * (grid.cells != OUTSIDE).sum()


def test_a_side_thinner_than_two_cells_has_one_and_the_others_are_nearly_cubes():
    grid = build_voxel_grid(*box((0, 0, 0), (1.9, 20, 20)), n_max=760)
    assert [side - 2 for side in grid.cells.shape] == [1, 20, 20]


def test_every_point_of_the_surface_is_contained_and_nothing_far_from_it_on_the_outside():
    points, triangles = ball()
    grid = build_voxel_grid(points, triangles, n_max=30_000)
    weights = np.random.default_rng(0).dirichlet([1, 1, 1], (5, len(triangles)))
    assert grid.contains(np.einsum("kmc,mcd->kmd", weights, points[triangles]).reshape(-1, 3)).all()
    assert not grid.contains(points / 10.0 * (10.0 + 1.01 * np.linalg.norm(grid.spacing))).any()
    assert not grid.contains(np.array([[1e30, 0.0, 0.0], [-1e30, 0.0, 0.0]])).any()


@pytest.mark.parametrize("flat", [(4.0, 2.0, 0.0), (4.0, 0.0, 0.0)])
def test_a_surface_without_volume_is_all_boundary(flat):
    points = np.array([[0.0, 0, 0], [1.0, 0, 0], [1.0, 1.0, 0], [0.3, 0.2, 0]]) * flat
    with pytest.warns(UserWarning, match=r"^bone 7: the surface is open: .* enclose no volume"):
        grid = build_voxel_grid(points, np.array([[0, 1, 2], [0, 2, 3]]), n_max=1000, what="bone 7")
    assert np.isfinite(grid.spacing).all()
    assert (grid.spacing > 0).all()
    assert grid.contains(points + 1e-6 * (points.mean(axis=0) - points)).all()
    assert not (grid.cells == INSIDE).any()


# ------------------------------------------------------------------------------------- real bones


@pytest.mark.realdata
@pytest.mark.parametrize(("bone", "published"), [*slow(("pelvis", 2_079_360)), ("femur_r", 2_064_480)])
def test_real_bones_have_about_as_many_cells_as_published(lhdl_hip, bone, published):
    points, triangles = read_bone(lhdl_hip, bone)
    counts = np.array(build_voxel_grid(points, triangles, n_max=DEFAULT_N_MAX).cells.shape) - 2
    assert 0.97 * published < counts.prod() < 1.03 * published
