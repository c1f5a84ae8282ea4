import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import igl
from scipy.spatial.transform import Rotation
from shapes import closed_surface

from vtkmuscle.core.morphing.correspondence import section_map
from vtkmuscle.core.morphing.slices import Slicing, morph_by_planes, shared_levels
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.template import TEMPLATES, sobol_points
from vtkmuscle.phantoms.implicit import thick_curve, union
from vtkmuscle.phantoms.meshing import box, mesh_of


def template(kind="parallel", n_fibres=20, resolution=10):
    """Return fibres in the unit cube, (n_fibres, resolution + 1, 3)."""
    return TEMPLATES[kind].fibres(*sobol_points(n_fibres).T, np.linspace(0, 1, resolution + 1))


def upright_box(points):
    """Return the transform of the unit cube to the box of points along the axes."""
    transform = np.diag([*np.ptp(points, axis=0), 1.0])
    transform[:3, 3] = points.min(axis=0)
    return transform


def morph(points, triangles, cube=None, transform=None, *, slice_tolerance=0.0, continuity=0.2, **other):
    """Return fibres in a muscle, shaped like those in the cube."""
    cube = template() if cube is None else cube
    transform = upright_box(points) if transform is None else transform
    fitted = apply_transform(transform, cube.reshape(-1, 3))
    settings_ = {"slice_tolerance": slice_tolerance, "continuity": continuity, **other}
    return morph_by_planes(
        fitted, transform, closed_surface(points, triangles), Slicing(**settings_)
    ).points.reshape(cube.shape)


def outside(places, points, triangles):
    """Return how far places are outside of a surface, 0 inside."""
    flat = places.reshape(-1, 3)
    distances = np.sqrt(igl.point_mesh_squared_distance(flat, points, triangles)[0])
    return np.where(igl.winding_number(points, triangles, flat) > 0.5, 0.0, distances)


@pytest.fixture(scope="module")
def banana():
    """A bent muscle, round, thick in its middle."""
    knots = [(0, 0, 0), (8, 3, 25), (10, 5, 50), (7, 2, 75), (0, 0, 100)]
    return mesh_of(thick_curve(knots, [5, 8, 10, 9, 5]), 2.0, 3000)


@pytest.fixture(scope="module")
def forked():
    """A muscle with two heads of different lengths at its lower end."""
    trunk = thick_curve([(0, 0, 50), (0, 0, 75), (0, 0, 100)], [12, 12, 10])
    thick = thick_curve([(-20, 0, 20), (-18, 0, 35), (-3, 0, 60)], [10, 10, 10])
    thin = thick_curve([(22, 0, 0), (19, 0, 30), (3, 0, 60)], [4, 4, 6])
    return mesh_of(union([trunk, thick, thin], 1.0), 1.5, 5000)


@pytest.mark.parametrize("kind", list(TEMPLATES))
@pytest.mark.parametrize("continuity", [0.0, 0.2])
def test_in_a_block_the_template_stays_as_it_is(kind, continuity):
    points, triangles = box((0, 0, 0), (20, 40, 120), 7.0)
    transform, move = upright_box(points), np.eye(4)
    move[:3, :3], move[:3, 3] = Rotation.from_euler("xyz", [0.4, 1.0, 2.0]).as_matrix(), (300, -50, 80)
    cube = template(kind)
    fibres = morph(apply_transform(move, points), triangles, cube, move @ transform, continuity=continuity)
    expected = apply_transform(move @ transform, cube.reshape(-1, 3)).reshape(cube.shape)
    # The first and last slice are a millionth of the length inside.
    assert np.abs(fibres - expected).max() < 1.3e-4


@pytest.mark.parametrize("kind", list(TEMPLATES))
def test_fibres_are_inside_and_keep_their_heights(banana, kind):
    points, triangles = banana
    cube = template(kind, 30, 12)
    fibres = morph(points, triangles, cube)
    assert np.isfinite(fibres).all()
    assert outside(fibres, points, triangles).max() < 0.1
    height = np.ptp(points[:, 2])
    assert np.abs(fibres[..., 2] - points[:, 2].min() - height * cube[..., 2]).max() < 1e-5 * height


def test_neighbours_stay_neighbours_and_do_not_turn_about_each_other(banana):
    points, triangles = banana
    corners = np.array([(0.25, 0.25), (0.75, 0.25), (0.75, 0.75), (0.25, 0.75)])
    fibres = morph(points, triangles, TEMPLATES["parallel"].fibres(*corners.T, np.linspace(0, 1, 40)))
    turned = [np.unwrap(np.angle((f[1:-1, :2] - fibres[:, 1:-1, :2].mean(axis=0)) @ [1, 1j])) for f in fibres]
    assert np.ptp(turned, axis=1).max() < np.radians(15)


def test_fibres_stay_in_the_head_that_holds_most(forked):
    points, triangles = forked
    fibres = morph(points, triangles, template("parallel", 40, 25))
    low = fibres[..., 2] < 40
    assert low.any()
    assert (fibres[low][:, 0] < 0).all()
    assert outside(fibres, points, triangles).max() < 0.2
    # The thin head reaches lower: what was below the thick one is squeezed into its tip, without folds.
    assert fibres[..., 2].min() == pytest.approx(points[points[:, 0] < -8][:, 2].min(), abs=0.01)
    assert (np.diff(fibres[..., 2], axis=1) > 0).all()
    assert np.linalg.norm(np.diff(fibres, axis=1), axis=2).min() > 0.1


def test_loops_are_never_mixed_in_a_ring():
    """A ring stood upright: two legs between one loop at the bottom and one at the top."""
    angles = np.linspace(-np.pi / 2, 3 * np.pi / 2, 13)
    ring = np.column_stack([40 * np.cos(angles), np.zeros(13), 40 * np.sin(angles)])
    # A little more to the left.
    points, triangles = mesh_of(thick_curve(ring, 8 - 2 * np.cos(angles)), 2.5, 4000)
    fibres = morph(points, triangles, template("parallel", 30, 20))
    middle = np.abs(fibres[..., 2]) < 25
    assert (fibres[middle][:, 0] < -15).all()
    assert outside(fibres, points, triangles)[middle.reshape(-1)].max() < 0.5


def test_a_hollow_is_not_taken_for_the_muscle():
    outer, faces = box((0, 0, 0), (20, 30, 60), 5.0)
    hollow, inner = box((5, 5, 20), (15, 25, 40), 5.0)
    points = np.vstack([outer, hollow])
    triangles = np.vstack([faces, inner[:, ::-1] + len(outer)])
    assert np.allclose(morph(points, triangles), morph(outer, faces), atol=1e-9)


def test_a_slice_that_is_the_rectangle_maps_to_itself(rng):
    loop = np.array([(4.0, 0), (4, 3), (2, 3), (0, 3), (0, 1), (0, 0)])
    places = rng.random((20, 2)) * [4, 3]
    for as_printed in (False, True):
        section = section_map(loop, np.zeros(2), np.array([4.0, 3.0]), as_printed=as_printed)
        assert np.allclose(section.positions(places), places, atol=1e-9)


def test_an_open_muscle_is_refused(banana):
    points, triangles = banana
    with pytest.raises(ValueError, match="must be closed"):
        morph(points, triangles[:-1])


def test_a_muscle_without_an_inside_is_refused():
    points = np.array([(0.0, 0, 0), (10, 0, 1), (3, 0, 30)])
    with pytest.raises(ValueError, match="no section of the muscle through the template has an inside"):
        morph(points, np.array([(0, 1, 2), (0, 2, 1)]), transform=np.diag([10.0, 1, 30, 1]))


@settings(max_examples=50)
@given(heights=st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=40), wide=st.booleans())
def test_heights_share_a_level_within_the_tolerance(heights, wide):
    heights, tolerance = np.array(heights), 10.0 if wide else 0.0
    levels, slice_of = shared_levels(heights, tolerance)
    assert (np.diff(levels) > 0).all()
    assert np.array_equal(np.unique(slice_of), np.arange(len(levels)))
    assert np.abs(levels[slice_of] - heights).max() <= tolerance / 2 * (1 + 1e-9)
    for level in range(len(levels)):
        assert np.ptp(heights[slice_of == level]) <= tolerance * (1 + 1e-9)
    if tolerance == 0.0:
        assert np.array_equal(levels, np.unique(heights))
