"""Thin and flat tendons against their known shapes, pulled, shortened and bent over an edge; and a belly."""

from functools import cache

import numpy as np
import pytest
from slow import slow

from vtkmuscle.core.bones.bone import bone_of
from vtkmuscle.core.fixed_muscle import FixedMuscle
from vtkmuscle.core.mesh.polylines import evenly_spread
from vtkmuscle.core.mesh.rest_shape import RestShape
from vtkmuscle.core.mesh.surface import edge_lengths, signed_volume
from vtkmuscle.core.motion.rigid import rotation_about
from vtkmuscle.core.paths.lines import bones_at_ends
from vtkmuscle.core.paths.sheet import MusclePaths
from vtkmuscle.core.skinning.carried_muscle import CarriedMuscle
from vtkmuscle.phantoms.meshing import solid_of_revolution

#: Length of a tendon along z, and radius of the edge that it is bent over, about x at half its length [mm].
LENGTH, EDGE = 100.0, 15.0
#: Half width (x) and half thickness (y) of elliptic sections [mm].
SECTIONS = {"cord": (2.0, 2.0), "band": (6.0, 1.0), "sheet": (15.0, 0.75)}
#: Points round the section, and rows of triangles; "slivers" are 12 to 1 along a cord.
MESHES = {"even": (12, 100), "coarse": (4, 30), "slivers": (16, 10)}
CASES = [(section, mesh) for section in SECTIONS for mesh in MESHES]
#: Rounds of settling and segments of a path, of the qualities preview, balanced and accurate.
QUALITIES = pytest.mark.parametrize(("rounds", "segments"), [*slow((2, 24)), (5, 32), *slow((20, 64))])


def tube(outline, rows):
    """Return a closed tube along z round an outline (k, 2)."""
    k = len(outline)
    z = np.repeat(np.linspace(0.0, LENGTH, rows + 1), k)
    shell = np.column_stack([np.tile(outline, (rows + 1, 1)), z])
    a = np.arange(k)
    b = (a + 1) % k
    strip = np.concatenate([np.column_stack([a, b, b + k]), np.column_stack([a, b + k, a + k])])
    lower, upper = len(shell), len(shell) + 1
    caps = (
        np.column_stack([np.full(k, lower), b, a]),
        np.column_stack([np.full(k, upper), rows * k + a, rows * k + b]),
    )
    triangles = np.concatenate([*(strip + row * k for row in range(rows)), *caps])
    return np.vstack([shell, [(0.0, 0.0, 0.0), (0.0, 0.0, LENGTH)]]), triangles


@cache
def tendon(section, mesh):
    """Return a tendon, its ends fixed to bones 0 (z = 0) and 1, with fibres inside."""
    half = np.array(SECTIONS[section])
    turn = np.linspace(0.0, 2.0 * np.pi, 2001)
    ellipse = half * np.column_stack([np.cos(turn), np.sin(turn)])
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(ellipse, axis=0), axis=1)))
    count, rows = MESHES[mesh]
    turn = np.interp(np.linspace(0.0, along[-1], count, endpoint=False), along, turn)
    points, triangles = tube(half * np.column_stack([np.cos(turn), np.sin(turn)]), rows)
    fixed_to = np.where(points[:, 2] == 0.0, 0, np.where(points[:, 2] == LENGTH, 1, -1))
    turn = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    places = np.vstack([(0.0, 0.0), 0.65 * half * np.column_stack([np.cos(turn), np.sin(turn)])])
    fibres = np.zeros((len(places), 16, 3))
    fibres[..., :2], fibres[..., 2] = places[:, None], np.linspace(0.0, LENGTH, 16)
    lines = fibres.reshape(-1, 3), 16 * np.arange(len(places) + 1)
    return FixedMuscle(points, triangles, fixed_to, fibres=lines)


def moved(muscle, poses, rounds, segments, bones=None):
    """Return the muscle after poses (k, 4, 4) of bone 0, beside which bone 1 stays; bones by their number."""
    bones = bones or {}
    fibres = evenly_spread(*muscle.fibres, segments + 1)
    ends = bones_at_ends(fibres, muscle.points, muscle.fixed_to)
    paths = MusclePaths(fibres, *ends, (muscle.points, muscle.triangles), bones)
    carried, state = CarriedMuscle(muscle, paths.rest.points, bones), paths.rest
    for transform in poses:
        state = paths.follow(state, np.array([transform, np.eye(4)]))
        assert state.settled
    surface = carried.pose(state.points, state.transforms, rounds=rounds).surface
    assert signed_volume(surface, muscle.triangles) == pytest.approx(
        signed_volume(muscle.points, muscle.triangles), rel=1e-6
    )
    return surface


def inside(muscle, section):
    """Return the points that are farther from the ends, which keep their width, than a width."""
    return (
        np.abs(muscle.points[:, 2] - LENGTH / 2.0)
        < LENGTH / 2.0 - 5.0 * SECTIONS[section][1] - SECTIONS[section][0]
    )


@QUALITIES
@pytest.mark.parametrize(("section", "mesh"), CASES)
@pytest.mark.parametrize(("stretch", "bound"), [(1.5, 0.12), (0.6, 0.45)])
def test_a_tendon_that_is_pulled_or_shortened_is_straight_and_keeps_its_volume(
    section, mesh, stretch, bound, rounds, segments
):
    """Affine: as much thinner across as keeps its volume. The bounds are those of the sheet, 30 mm wide."""
    muscle, poses = tendon(section, mesh), np.tile(np.eye(4), (3, 1, 1))
    poses[:, 2, 3] = (1.0 - stretch) * LENGTH * np.linspace(1.0 / 3.0, 1.0, 3)
    known = muscle.points * [stretch**-0.5, stretch**-0.5, stretch] + [0.0, 0.0, (1.0 - stretch) * LENGTH]
    off = np.linalg.norm(moved(muscle, poses, rounds, segments) - known, axis=1)[inside(muscle, section)]
    assert off.max() < bound * (1.0 if section == "sheet" else 0.5)


def edge(thickness):
    """Return a cylinder about x that a tendon of half a thickness touches at half its length."""
    points, triangles = solid_of_revolution(
        np.linspace(-30.0, 30.0, 13), np.full(13, EDGE / np.cos(np.pi / 120)), 120
    )
    return points[:, [2, 0, 1]] + [0.0, EDGE + thickness, LENGTH / 2.0], triangles


def bent(points, thickness, turn):
    """Return where the points of a straight tendon are once its lower half is turned about the edge.

    Each line along it lies round the edge at its distance, which shrinks as it gets longer.
    """
    x, y, z = points.T
    width = np.ones_like(x)
    for _ in range(30):
        radius = EDGE + (thickness - y) * width
        width = (1.0 + radius * turn / LENGTH) ** -0.5
    along = z * (1.0 + radius * turn / LENGTH)
    lower, wound = along < LENGTH / 2.0, along < LENGTH / 2.0 + radius * turn
    angle = np.where(lower, turn, np.where(wound, turn - (along - LENGTH / 2.0) / radius, 0.0))
    height = np.where(lower, along - LENGTH / 2.0, np.where(wound, 0.0, along - LENGTH / 2.0 - radius * turn))
    across = -radius * np.cos(angle) - height * np.sin(angle) + EDGE + thickness
    return np.column_stack(
        [x * width, across, height * np.cos(angle) - radius * np.sin(angle) + LENGTH / 2.0]
    )


@QUALITIES
@pytest.mark.parametrize(("section", "mesh"), CASES)
def test_a_tendon_bends_over_an_edge(section, mesh, rounds, segments):
    """By 90 degrees; 24 segments are each 4 to 5 mm long, so that the polyline is up to 0.2 mm inside."""
    muscle, (_, thickness) = tendon(section, mesh), SECTIONS[section]
    bones = {1: bone_of(*edge(thickness))}
    centre = 0.0, EDGE + thickness, LENGTH / 2.0
    poses = [rotation_about(centre, (1.0, 0.0, 0.0), angle) for angle in np.linspace(0.0, 90.0, 10)[1:]]
    known = bent(muscle.points, thickness, np.pi / 2.0)
    off = np.linalg.norm(moved(muscle, poses, rounds, segments, bones) - known, axis=1)
    assert np.percentile(off[inside(muscle, section)], 95) < 1.4


def belly(sides=24, rows=40):
    """Return a fusiform muscle along z, 5 to 15 mm in radius, fixed at both ends."""

    def radius(part):
        return 5.0 + 10.0 * np.sin(np.pi * part) ** 2

    part = np.linspace(0.0, 1.0, rows + 1)
    points, triangles = solid_of_revolution(LENGTH * part, radius(part), sides)
    fixed_to = np.where(points[:, 2] == 0.0, 0, np.where(points[:, 2] == LENGTH, 1, -1))
    turn = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    places = np.vstack([(0.0, 0.0), 0.4 * ring[::2], 0.8 * ring])
    fibres = np.zeros((len(places), 32, 3))
    fibres[..., 2] = np.linspace(0.0, LENGTH, 32)
    fibres[..., :2] = places[:, None] * radius(np.linspace(0.0, 1.0, 32))[:, None]
    lines = fibres.reshape(-1, 3), 32 * np.arange(len(places) + 1)
    return FixedMuscle(points, triangles, fixed_to, fibres=lines)


@QUALITIES
def test_a_muscle_that_shortens_to_three_fifths_thickens_smoothly(rounds, segments):
    """To 0.6^(-1/2) of its thickness, but for its ends, which keep theirs."""
    muscle, poses = belly(), np.tile(np.eye(4), (8, 1, 1))
    topology = muscle.topology()
    lengths = edge_lengths(muscle.points, topology.edges)
    rises = np.abs(np.diff(muscle.points[topology.edges, 2], axis=1)[:, 0])
    across = (lengths > 0.0) & (rises < np.cos(np.radians(72.0)) * lengths)
    poses[:, 2, 3] = 0.4 * LENGTH * np.linspace(0.125, 1.0, 8)
    surface = moved(muscle, poses, rounds, segments)
    middle = np.abs(muscle.points[:, 2] - LENGTH / 2.0) < 0.2 * LENGTH
    thicker = np.hypot(*surface[middle, :2].T) / np.hypot(*muscle.points[middle, :2].T)
    np.testing.assert_allclose(thicker, 0.6**-0.5, rtol=0.08)
    assert RestShape(muscle.points, topology).compare(surface).dihedral_error_p95 < 20.0
    stretch = edge_lengths(surface, topology.edges[across]) / lengths[across]
    assert 0.8 < np.percentile(stretch, 5) < np.percentile(stretch, 95) < 1.4
