from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from phantoms import fibre_block
from scipy.spatial import ConvexHull, Delaunay, cKDTree
from shapes import lines_of, turns_of
from slow import slow
from vtkmodules.vtkFiltersSources import vtkSphereSource

from vtkmuscle import Scene
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.data.arrays import cell_array, checked_surface, points_of, polylines_of
from vtkmuscle.data.attachments import attachments_of
from vtkmuscle.data.muscle_geometry import surface_of
from vtkmuscle.filters.fibre_smoother import FibreSmoother
from vtkmuscle.phantoms import hip, spindle_over_hinge
from vtkmuscle.pipelines import decompose


def noisy_fibres():
    rng, t = np.random.default_rng(0), np.linspace(0, 1, 12)
    lines = np.array([np.column_stack([100 * t, 5 * np.sin(3 * t) + i, 0 * t]) for i in range(4)])
    return lines + rng.normal(scale=0.5, size=(48, 3)).reshape(4, 12, 3)


def test_inner_points_follow_the_formula_and_end_points_stay():
    lines = noisy_fibres()
    smoothed = points_of(FibreSmoother(smoothing_passes=1, smoothing_weight=4.0)(lines_of(lines))).reshape(
        4, 12, 3
    )
    p = lines
    assert_allclose(smoothed[:, 1:-1], (p[:, :-2] + 4 * p[:, 1:-1] + p[:, 2:]) / 6, atol=1e-12)
    assert_array_equal(smoothed[:, [0, -1]], p[:, [0, -1]])


def test_points_stay_in_the_muscle_where_it_is_connected():
    ball = vtkSphereSource(radius=10.0, theta_resolution=40, phi_resolution=40).update().output
    t = np.linspace(0, np.pi, 16)
    # From side to side just inside, with one point far out.
    arch = np.column_stack([9.9 * np.cos(t), 0 * t, 9.9 * np.sin(t)])
    arch[8] *= 1.5
    fibres, surface = lines_of([arch]), solids_of(*checked_surface(ball, "test"))
    alone = points_of(FibreSmoother(smoothing_passes=1)(fibres))
    kept = points_of(FibreSmoother(smoothing_passes=1)(fibres, ball))
    outside = surface.depth(alone) == 0
    assert outside[8]
    assert_allclose(kept[~outside], alone[~outside], atol=0)
    assert_allclose(np.abs(surface.distances(kept[outside])), 0.0, atol=1e-9)
    assert_array_equal(kept[[0, -1]], arch[[0, -1]])


def test_a_wave_is_smoothed_alike_whatever_the_number_of_segments():
    ball, left = vtkSphereSource(radius=99.0).update().output, []
    for segments in (8, 15, 31, 90):
        t = np.linspace(0.0, 1.0, segments + 1)
        waves = [np.column_stack([60 * t - 30, side * np.sin(4 * np.pi * t), 0 * t]) for side in (-1, 1)]
        smoothed = points_of(FibreSmoother(spreading=0.0)(lines_of(waves), ball)).reshape(2, -1, 3)
        left.append(np.vdot(smoothed[1, :, 1], waves[1][:, 1]) / np.vdot(waves[1], [0, 1, 0] * waves[1]))
    assert_allclose(left, left[-1], rtol=0.1)
    assert 0.2 < left[-1] < 0.9


def test_with_spreading_a_fibre_in_a_ball_runs_through_its_middle():
    ball = vtkSphereSource(radius=10.0, theta_resolution=40, phi_resolution=40).update().output
    t = np.linspace(-1, 1, 16)
    fibre = lines_of([np.column_stack([9 * t, 3 + 0 * t, 0 * t])])
    smoothed = points_of(FibreSmoother(spreading=1.0)(fibre, ball))
    assert np.abs(smoothed[3:-3, 1:]).max() < 0.8
    assert_array_equal(smoothed[[0, -1]], points_of(fibre)[[0, -1]])


def test_with_spreading_ends_move_on_their_areas():
    phantom = spindle_over_hinge()
    ((name, muscle),) = phantom.muscles.items()
    attachments = phantom.attachments[name]
    rest = decompose(muscle, attachments, n_fibres=30, spreading=0.0).update().output
    held = points_of(FibreSmoother(spreading=1.5)(rest, muscle)).reshape(30, -1, 3)
    moved = points_of(FibreSmoother(spreading=1.5)(rest, muscle, attachments)).reshape(30, -1, 3)
    assert_array_equal(held[:, [0, -1]], points_of(rest).reshape(30, -1, 3)[:, [0, -1]])
    assert np.linalg.norm(moved - held, axis=2)[:, [0, -1]].max() > 0.3
    geometry = surface_of(muscle, "muscle").geometry
    for end, role in ((0, "origin"), (-1, "insertion")):
        covered = geometry.covered(attachments_of(attachments, ""), role)
        assert_allclose(covered.distances(moved[:, end]), 0.0, atol=1e-9)


@pytest.mark.parametrize("phantom", [fibre_block("parallel"), spindle_over_hinge()], ids=lambda p: p.name)
def test_neighbours_by_their_parameters_stay_neighbours_in_every_slice_as_fibres_are_spread(phantom):
    ((name, muscle),) = phantom.muscles.items()
    chain = decompose(muscle, phantom.attachments[name], phantom.superficial.get(name), template="parallel")
    fibres = chain.update().output
    lines = polylines_of(fibres, "test").points.reshape(100, 16, 3)
    places = np.column_stack([cell_array(fibres, word, "test") for word in ("r", "s")])
    triangles = Delaunay(places).simplices
    i, j = np.unique(np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0).T
    near = np.linalg.norm(places[i] - places[j], axis=1) < 0.2  # two spacings: none along the border
    i, j = i[near], j[near]
    assert len(i) > 200
    for points in np.moveaxis(lines, 1, 0):
        across = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][:2]
        spacing = np.sqrt(ConvexHull(points @ across.T).volume / 100)
        apart = np.linalg.norm(points[i] - points[j], axis=1) / spacing
        # 1.8 for 95 % of them in the template; any two fibres are 5 apart on the mean.
        assert np.percentile(apart, 95) < 3.0
        assert apart.max() < 5.0


def nearest_fibre(places, lines):
    """Return how far places (n, 3) are from the nearest fibre, closely sampled."""
    share = np.linspace(0.0, 1.0, 12)[:, None]
    dense = [a + share * (b - a) for line in map(lines.line, range(len(lines))) for a, b in pairwise(line)]
    return cKDTree(np.vstack(dense)).query(places)[0]


def bare_share(muscle, attachments, **settings):
    """Return the part of a muscle that is farther than two spacings from any of its 100 fibres."""
    lines = polylines_of(decompose(muscle, attachments, **settings).update().output, "test")
    geometry = surface_of(muscle, "test").geometry
    apart = nearest_fibre(geometry.samples(8192), lines)
    volume = abs(signed_volume(geometry.points, geometry.triangles))
    spacing = np.sqrt(volume / polyline_lengths(lines.points, lines.offsets).sum())
    return float((apart > 2.0 * spacing).mean())


@pytest.mark.parametrize(
    ("make", "name", "templates"),
    [
        (spindle_over_hinge, "spindle", ["pennate", "bipennate"]),
        *slow((hip, "gluteus_maximus", ["pennate", "bipennate", "curved", "fan"])),
    ],
    ids=["spindle", "gluteus maximus"],
)
def test_fibres_of_every_template_that_were_led_to_the_areas_fill_the_muscle(make, name, templates):
    phantom = make()
    given = phantom.muscles[name], phantom.attachments[name]
    for template in templates:
        still, whole = (bare_share(*given, template=template, **own) for own in ({"spreading": 0.0}, {}))
        assert whole < 0.03
        assert still > 0.04
        assert whole < 0.2 * still


@pytest.mark.parametrize("kind", ["pennate", "bipennate", "curved", "fan"])
def test_what_a_template_leaves_free_in_a_muscle_of_its_own_architecture_stays_free(kind):
    phantom = fibre_block(kind)
    given = phantom.muscles["block"], phantom.attachments["block"]
    whole, still = (
        points_of(decompose(*given, template=kind, n_fibres=30, **settings).update().output)
        for settings in ({}, {"spreading": 0.0})
    )
    assert_array_equal(whole, still)


@pytest.mark.realdata
@pytest.mark.gap("distance to the nearest fibre relative to even fibres, iliacus", "2.2", "1.5")
@pytest.mark.parametrize(
    ("name", "bound"),
    [*slow(("gluteus_maximus", 1.5), ("gluteus_medius", 1.5), ("iliacus", 2.25)), ("adductor_brevis", 1.5)],
)
def test_a_hundred_fibres_cover_real_muscles_nearly_as_well_as_evenly_spaced_ones(name, bound, lhdl_hip):
    scene = Scene.load(lhdl_hip / "scene.toml")
    muscle = scene.muscles[name].surface
    lines = polylines_of(decompose(muscle, scene.attachments_data(name)).update().output, name)
    geometry = surface_of(muscle, name).geometry
    places = np.random.default_rng(1).uniform(geometry.points.min(0), geometry.points.max(0), (60_000, 3))
    inside = places[geometry.solids.depth(places) > 0.0]
    assert len(inside) > 5000
    found = np.percentile(nearest_fibre(inside, lines), 95)
    # 95 % of a hexagon of inner radius r is nearer than 1.035 r to its centre.
    volume = abs(signed_volume(geometry.points, geometry.triangles))
    even = 1.035 * np.sqrt(volume / (12.0**0.5 * polyline_lengths(lines.points, lines.offsets).sum()))
    assert found <= bound * even


def test_fibres_that_are_held_at_the_rim_of_a_broad_area_do_not_hook_there():
    phantom = hip()
    muscle, areas = phantom.muscles["gluteus_medius"], phantom.attachments["gluteus_medius"]
    fibres = decompose(muscle, areas, n_fibres=100, resolution=15, method="harmonic").update().output
    assert turns_of(points_of(fibres).reshape(100, 16, 3)).max() <= 60
