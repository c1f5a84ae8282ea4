"""Pictures: what is on them in numbers, and that they can be made, or a reason is given."""

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib import rc_context
from shapes import lines_of

from vtkmuscle import Scene, phantoms
from vtkmuscle.data.arrays import add_arrays, multiblock_from, points_of, with_points
from vtkmuscle.plotting import Studio, can_render, choose_view, drawing, make_plotter, plot_lengths
from vtkmuscle.plotting.figures import plot_moment_arms, plot_rest_pose, positions_across, shown_range
from vtkmuscle.plotting.sheets import Pixels, set_style
from vtkmuscle.plotting.studio import actors_of, strain_colours
from vtkmuscle.plotting.views import DrawnBones, framed


def spindle():
    """A muscle 100 mm long and 30 mm thick along z, fixed to bone 1 above and bone 0 below."""
    surface = pv.Sphere(radius=1.0, theta_resolution=24, phi_resolution=32).scale((15.0, 15.0, 50.0))
    z = surface.points[:, 2]
    fixed = np.where(z > 44.0, 1, np.where(z < -44.0, 0, -1)).astype(np.int32)
    muscle = with_points(surface, points_of(surface))
    add_arrays(muscle, points={"FixedTo": fixed})
    return muscle


def straight_fibres(shift=0.0):
    t = np.linspace(-45.0, 45.0, 16)
    lines = [
        np.column_stack([np.full(16, x), np.full(16, y), (1.0 + shift) * t]) for x, y in [(-4, 0), (4, 3)]
    ]
    return lines_of(lines)


def two_bones(y=25.0):
    """Two plates behind the muscle, on its +y side."""
    lower = pv.Cube(center=(0, y, -40), x_length=80, y_length=8, z_length=70).triangulate()
    upper = pv.Cube(center=(0, y, 40), x_length=80, y_length=8, z_length=70).triangulate()
    return multiblock_from({"lower": lower, "upper": upper})


def picture(plotter):
    image = plotter.screenshot(return_img=True).astype(int)
    plotter.close()
    return image


def pixels_of(figure):
    return [artist for artist in figure.get_children() if isinstance(artist, Pixels)]


def blue_pixels(image, by=60):
    return int((image[..., 2] > image[..., 0] + by).sum())


def test_a_window_that_renders_nothing_is_not_taken_for_success(renders, monkeypatch):
    monkeypatch.setattr(drawing, "TEST_PICTURE", drawing.TEST_PICTURE.replace("(1, 0, 0)", "(0, 0, 0)"))
    can_render.cache_clear()
    reason = can_render()
    can_render.cache_clear()
    assert "could not be rendered" in reason


def test_a_muscle_is_seen_from_the_side_that_no_bone_hides():
    view = choose_view([spindle()], [two_bones(y=25.0)])
    assert view.direction[1] < -0.65
    view = choose_view([spindle()], [two_bones(y=-25.0)])
    assert view.direction[1] > 0.65


@settings(max_examples=40)
@given(st.floats(0.0, 360.0), st.floats(-60.0, 60.0), st.integers(0, 2**32 - 1))
def test_a_frame_encloses_all_points(azimuth, elevation, seed):
    a, e = np.radians([azimuth, elevation])
    direction = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    points = np.random.default_rng(seed).normal(size=(30, 3)) * [40.0, 5.0, 90.0]
    view = framed(direction, points, margin=0.1)
    right = np.cross([0.0, 0.0, 1.0], direction)
    right /= np.linalg.norm(right)
    up, local = np.cross(direction, right), points - view.focus
    assert np.abs(local @ up).max() <= view.half_height
    assert np.abs(local @ right).max() <= view.half_height * view.aspect * (1.0 + 1e-9)


def coloured(*strain):
    return strain_colours(np.array(strain), 10.0)


def test_fixed_points_are_marked_in_the_colour_of_their_bone(renders):
    muscle, bones = spindle(), two_bones()
    view = choose_view([muscle], [bones])
    plain = picture(make_plotter(bones, [muscle], view))
    marked = picture(make_plotter(bones, [muscle], view, fixed_points=True))
    assert blue_pixels(plain) == 0
    height = marked.shape[0]
    # Bone 0 has the blue of the palette and holds the lower end of the muscle.
    assert blue_pixels(marked[height // 2 :]) > 100
    assert blue_pixels(marked[: height // 2]) == 0


def test_a_fibre_that_shortens_is_blue_and_one_that_lengthens_is_not(renders):
    muscle, bones, fibres = spindle(), two_bones(), straight_fibres()
    view = choose_view([muscle], [bones])
    shorter = picture(make_plotter(bones, [muscle], view, fibres=fibres, colours=coloured(-9.0, -9.0)))
    longer = picture(make_plotter(bones, [muscle], view, fibres=fibres, colours=coloured(9.0, 9.0)))
    assert blue_pixels(shorter, by=20) > 2000
    assert blue_pixels(longer, by=20) == 0


def test_fibres_are_seen_in_small_pictures(renders):
    """VTK gives fibres thinner than a pixel no normals: they were not drawn, with errors of shaders."""
    muscle, bones, fibres = spindle(), two_bones(), straight_fibres()
    view, options = choose_view([muscle], [bones]), {"colours": coloured(-9.0, -9.0)}
    with Studio(1.0 / 16.0) as studio:
        actors = actors_of([muscle], view, fibres=fibres, **options, finer=studio.finer)
        assert blue_pixels(studio.picture(actors, view).astype(int), by=20) > 20


def test_a_picture_of_a_studio_is_that_of_a_plotter(renders):
    """Two ways to light and to smooth edges, one scene."""
    muscle, bones, fibres = spindle(), two_bones(), straight_fibres()
    view = choose_view([muscle], [bones])
    options = {"fibres": fibres, "fixed_points": True, "colours": coloured(-9.0, 9.0)}
    slowly = picture(make_plotter(bones, [muscle], view, **options))
    with Studio() as studio:
        actors = actors_of([muscle], view, **options, finer=studio.finer)
        quickly = studio.picture(actors, view, bones=DrawnBones(bones)).astype(int)
    assert quickly.shape == slowly.shape
    difference = np.abs(quickly - slowly).max(axis=2)
    assert np.median(difference[slowly.min(axis=2) < 250]) <= 3
    assert np.mean(difference > 40) < 0.03


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_places_are_in_the_order_across_the_fibres(seed):
    """Fibres side by side that begin wherever they like, and run along z."""
    rng = np.random.default_rng(seed)
    across = rng.permutation(np.linspace(-30.0, 30.0, 12))
    starts = rng.uniform(-200.0, 200.0, 12)
    points = [[[x, 0.2 * x, s + t] for t in (0.0, 40.0, 80.0)] for x, s in zip(across, starts, strict=True)]
    lines = lines_of(points)
    np.testing.assert_allclose(positions_across(lines), (across + 30.0) / 60.0, atol=1e-9)


def test_one_spike_does_not_flatten_an_axis():
    arms = 40.0 + np.random.default_rng(0).normal(size=(50, 100))
    arms[7, 3] = 800.0
    low, high = shown_range(arms, np.full(50, 40.0))
    assert low <= 0.0
    assert 42.0 < high < 50.0


def test_the_length_figure_shows_each_fibre_and_the_mean():
    lengths = np.array([[10.0, 20.0, 60.0], [11.0, 19.0, 63.0]])
    axes = plot_lengths([0.0, 5.0], lengths).axes[0]
    (fibres,) = axes.collections
    for path, one in zip(fibres.get_paths(), lengths.T, strict=True):
        np.testing.assert_array_equal(path.vertices, np.column_stack([[0.0, 5.0], one]))
    (mean,) = [line.get_ydata() for line in axes.lines if len(line.get_xdata())]
    np.testing.assert_allclose(mean, [30.0, 31.0])
    low, high = axes.get_ylim()
    assert low < 10.0
    assert high > 63.0


def test_titles_of_any_letters_and_length_are_on_the_picture():
    title = "a_subject_of_a_study: $_{$ fixed points at rest"
    with rc_context():
        set_style()
        figure = plot_lengths([0.0], [[1.0]], title=title, width=85.0)
        (written,) = (text for text in figure.texts if text.get_text() == title)
        box = written.get_window_extent()
    assert 0.0 <= box.x0 < box.x1 <= figure.bbox.width
    assert figure.axes[0].get_legend_handles_labels()[1] == ["1 path", "mean"]


def test_moment_arms_of_a_single_pose_are_dots():
    result = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=3).run(frames=3)
    assert "1 frame of spindle" in repr(result)
    arms = result.moment_arms()["spindle"]
    dots = plot_moment_arms(arms).axes[0].collections[0].get_offsets()
    np.testing.assert_allclose(dots[:, 1], arms["distal_angle"].arms[0])


def test_fixed_points_are_seen_through_bones_in_the_rest_pose(renders):
    around = multiblock_from({"lower": pv.Cube(x_length=90, y_length=90, z_length=190).triangulate()})
    with Studio() as studio:
        (panel,) = pixels_of(plot_rest_pose({"spindle": spindle()}, DrawnBones(around), studio))
    assert blue_pixels(panel.image.astype(int), by=20) > 100


@pytest.mark.parametrize("n_fixed", [1, 2, 7])
def test_the_legend_of_the_rest_pose_is_on_the_picture_and_names_bones_that_hold_points(renders, n_fixed):
    bones = multiblock_from({f"a_bone_with_a_long_name_{i}": pv.Sphere(radius=10.0) for i in range(8)})
    muscle = pv.Sphere(radius=20.0)
    add_arrays(muscle, points={"FixedTo": np.arange(muscle.n_points) % (n_fixed + 1) - 1})
    with Studio() as studio:
        figure = plot_rest_pose({"ball": muscle}, DrawnBones(bones), studio)
    (legend,) = figure.legends
    box = legend.get_window_extent()
    assert 0 <= box.x0 < box.x1 <= figure.bbox.width
    assert box.y1 <= min(panel.corner[1] for panel in pixels_of(figure)) * figure.dpi
    assert len(legend.get_texts()) == n_fixed
