"""Muscles of known courses and thicknesses, with and without tendons."""

import numpy as np
import pytest
from phantoms import fibre_block

from vtkmuscle.core.fibres.measures import TENDON_AREA, AreaProfile, along, area_profile, fascicles
from vtkmuscle.data.arrays import polylines_of
from vtkmuscle.data.muscle_geometry import muscle_geometry
from vtkmuscle.phantoms.meshing import solid_of_revolution
from vtkmuscle.pipelines import decompose

#: A belly of radius 12 mm and 80 mm long, with tendons of radius 2 mm, 60 mm and 40 mm long.
BELLY, TENDON, LONG = 12.0, 2.0, (60.0, 80.0, 40.0)


def bent(places):
    """Return places of a straight muscle along z, 180 mm, bent round an axis 100 mm aside, by 1.8 rad."""
    angle = places[..., 2] / 100.0
    off = 100.0 + places[..., 0]
    return np.stack([off * np.cos(angle) - 100.0, places[..., 1], off * np.sin(angle)], axis=-1)


def spindle(rng, count=30000):
    """Return the surface, samples, volumes of the parts, and 12 fibres through belly and tendons."""
    heights = np.concatenate([np.linspace(a, b, 31) for a, b in ((0, 60), (60.01, 140), (140.01, 180))])
    around = solid_of_revolution(heights, np.repeat([TENDON, BELLY, TENDON], 31), 24)
    volumes = np.pi * np.array([TENDON, BELLY, TENDON]) ** 2 * LONG
    part = rng.choice(3, count, p=volumes / volumes.sum())
    z = np.cumsum([0.0, *LONG])[part] + rng.uniform(size=count) * np.array(LONG)[part]
    radius = np.array([TENDON, BELLY, TENDON])[part] * np.sqrt(rng.uniform(size=count))
    turn = rng.uniform(0.0, 2.0 * np.pi, count)
    samples = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), z])
    heights = np.linspace(0.0, 180.0, 37)
    wide = np.interp(heights, [0.0, 60.0, 140.0, 180.0], [0.1, 0.6, 0.6, 0.1]) * BELLY
    turns = 2.0 * np.pi * np.arange(12) / 12
    fibres = np.array([np.column_stack([wide * np.cos(t), wide * np.sin(t), heights]) for t in turns])
    return around, samples, volumes, fibres.reshape(-1, 3), np.arange(13) * 37


@pytest.mark.parametrize("shape", [lambda p: p, bent], ids=["straight", "bent"])
def test_tendons_are_told_from_the_belly(rng, shape):
    (surface, triangles), samples, volumes, points, offsets = spindle(rng)
    surface, samples, points = shape(surface), shape(samples), shape(points)
    profile = area_profile(surface, triangles, samples, points, offsets)
    low, high = profile.muscle_between(TENDON_AREA)
    assert high - low == pytest.approx(80.0, abs=5.0)
    assert profile.areas.max() == pytest.approx(np.pi * BELLY**2, rel=0.1)
    (found,) = fascicles(profile, volumes.sum(), points, offsets, shares=[TENDON_AREA])
    assert found.volume == pytest.approx(volumes[1], rel=0.02)
    assert found.lengths.mean() == pytest.approx(80.0, abs=5.0)


def test_the_volume_between_two_arcs_counts_parts_of_pieces():
    profile = AreaProfile(np.zeros((2, 3)), np.array([0.5, 1.5, 2.5, 3.5]), np.array([1.0, 2.0, 3.0, 4.0]))
    assert profile.volume_share(0.0, 4.0) == pytest.approx(1.0)
    assert profile.volume_share(0.25, 2.5) == pytest.approx((0.75 + 2.0 + 1.5) / 10.0)
    assert profile.volume_share(2.5, 9.0) == pytest.approx((1.5 + 4.0) / 10.0)


@pytest.mark.parametrize("kind", ["parallel", "pennate", "bipennate"])
def test_blocks_have_the_fascicles_angles_and_areas_that_are_known(kind):
    phantom = fibre_block(kind)
    muscle, areas, known = phantom.muscles["block"], phantom.attachments["block"], phantom.known
    lines = polylines_of(decompose(muscle, areas, template=kind, n_fibres=50).update().output, kind)
    geometry, fibres = muscle_geometry(muscle, kind), (lines.points, lines.offsets)
    profile = area_profile(geometry.points, geometry.triangles, geometry.samples(4096), *fibres)
    (found,) = fascicles(profile, known["volume"], *fibres, shares=[TENDON_AREA])
    angle = 0.0 if kind == "parallel" else known["pennation"]
    assert found.lengths.mean() == pytest.approx(known["fibre_length"], rel=0.01)
    for angles in (found.origin_angles, found.insertion_angles):
        assert angles.mean() == pytest.approx(angle, abs=1.0)
    area = known["volume"] / known["fibre_length"] * np.cos(np.radians(angle))
    assert found.cross_section() == pytest.approx(area, rel=0.02)


def test_a_curve_goes_on_straight_beyond_its_ends():
    curve = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 10.0], [10.0, 0.0, 10.0]])
    places = np.array([[1.0, 0.0, -3.0], [2.0, 0.0, 4.0], [14.0, 1.0, 9.0]])
    arcs, directions = along(curve, places)
    np.testing.assert_allclose(arcs, [-3.0, 4.0, 24.0])
    np.testing.assert_allclose(directions, [[0, 0, 1], [0, 0, 1], [1, 0, 0]])
