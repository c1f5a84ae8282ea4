import numpy as np
import pytest
import pyvista as pv
from hypothesis import given, settings
from hypothesis import strategies as st
from shapes import convex, grid

from vtkmuscle.core.attachments.patches import attachment_patch, ring_sides
from vtkmuscle.core.mesh.surface import edge_lengths, unique_edges

RADIUS = 20.0


def ball(n_points=3000):
    """Return a triangulated sphere with points of no particular order."""
    rng, i = np.random.default_rng(8), np.arange(n_points) + 0.5
    z, angle = 1 - 2 * i / n_points, np.pi * (1 + 5**0.5) * i
    flat = np.sqrt(1 - z * z)
    points = RADIUS * np.column_stack([flat * np.cos(angle), flat * np.sin(angle), z])
    return convex(points[rng.permutation(n_points)])


BALL = ball()
EDGE = edge_lengths(BALL[0], unique_edges(BALL[1])).mean()


def latitude_ring(polar, *, n=24, radius=RADIUS):
    angle = 2 * np.pi * np.arange(n) / n
    across, up = np.sin(np.radians(polar)), np.cos(np.radians(polar))
    return radius * np.column_stack([across * np.cos(angle), across * np.sin(angle), np.full(n, up)])


def polar_angles():
    return np.degrees(np.arccos(BALL[0][:, 2] / RADIUS))


def is_cap(patch, polar):
    """Return True where the patch is all points nearer to the pole, give or take an edge."""
    slack = np.degrees(EDGE / RADIUS)
    angles, chosen = polar_angles(), np.zeros(len(BALL[0]), dtype=bool)
    chosen[patch] = True
    return bool(chosen[angles < polar - slack].all() and not chosen[angles > polar + slack].any())


@pytest.mark.parametrize("polar", [15.0, 40.0, 75.0])
def test_a_ring_gives_the_cap_that_it_encloses_and_has_equal_sides(polar):
    assert is_cap(attachment_patch(*BALL, latitude_ring(polar), True).points, polar)
    assert np.ptp(ring_sides(latitude_ring(polar))) < 1e-12


def test_a_ring_that_crosses_itself_keeps_all_its_loops():
    t = 2 * np.pi * np.arange(32) / 32
    eight = np.column_stack([12 * np.sin(t), 6 * np.sin(2 * t), np.full(32, RADIUS)])
    patch = attachment_patch(*BALL, eight, True).points
    chosen = np.zeros(len(BALL[0]), dtype=bool)
    chosen[patch] = True
    x, y, z = BALL[0].T
    in_lobes = (np.hypot(np.abs(x) - 8, y) < 2) & (z > 0)
    assert in_lobes.sum() > 10
    assert chosen[in_lobes].all()
    assert not chosen[(z < 0) | ((np.abs(y) > 5) & (np.abs(x) < 2))].any()


def test_the_bone_decides_between_sides_of_like_size():
    ring = latitude_ring(95.0)

    def below(positions):  # a bone with a flat face
        return positions[:, 2] + RADIUS

    def above(positions):
        return RADIUS - positions[:, 2]

    assert is_cap(attachment_patch(*BALL, ring, True, bone_distance=above).points, 95.0)
    lower = attachment_patch(*BALL, ring, True, bone_distance=below).points
    assert is_cap(np.setdiff1d(np.arange(len(BALL[0])), lower), 95.0 - np.degrees(EDGE / RADIUS))
    np.testing.assert_array_equal(lower, attachment_patch(*BALL, ring, True).points)


THICK = 6.0


def slab():
    """Return a flat muscle, 60 x 30 x 6 mm, between z = 0 and z = 6."""
    sheet = pv.Box((-30.0, 30.0, -15.0, 15.0, 0.0, THICK), level=19, quads=False).clean()
    return np.asarray(sheet.points, dtype=np.float64), sheet.faces.reshape(-1, 4)[:, 1:].astype(np.int64)


SLAB = slab()


def beneath(positions):
    """Return the distances from a bone, on whose flat face the muscle lies."""
    return positions[:, 2]


def oval(height, *, n=24):
    angle = 2 * np.pi * np.arange(n) / n
    return np.column_stack([15 * np.cos(angle), 8 * np.sin(angle), np.full(n, height)])


def within_oval(patch):
    """Return True where the patch is all of the lower face within the oval, give or take an edge."""
    x, y, z = SLAB[0].T
    r, slack = np.hypot(x / 15, y / 8), 3.0 / 8.0
    chosen, lower = np.isin(np.arange(len(SLAB[0])), patch), z == 0.0
    return bool(chosen[lower & (r < 1 - slack)].all() and not chosen[~lower | (r > 1 + slack)].any())


@pytest.mark.parametrize("height", [-10.0, -1.0, 2.0, 4.0, THICK, THICK + 4.0])
def test_the_patch_is_on_the_side_of_the_bone_wherever_the_landmarks_are(height):
    """Landmarks in the muscle, or beyond it, are nearer to the face that looks away from the bone."""
    assert within_oval(attachment_patch(*SLAB, oval(height), True, bone_distance=beneath).points)
    turned = SLAB[0], SLAB[1][:, ::-1]  # inside out
    assert within_oval(attachment_patch(*turned, oval(height), True, bone_distance=beneath).points)
    patch = attachment_patch(*SLAB, oval(height)[:8], False, tolerance=3.0, bone_distance=beneath).points
    assert (SLAB[0][patch][:, 2] == 0.0).all()


@settings(max_examples=20)
@given(
    seed=st.integers(0, 2**32 - 1),
    off=st.floats(-10.0, 10.0),
    jitter=st.floats(0.0, 1.0),
    backwards=st.booleans(),
    repeated=st.integers(1, 3),
    start=st.integers(0, 23),
)
def test_perturbed_rings_give_the_same_patch_up_to_the_perturbation(
    seed, off, jitter, backwards, repeated, start
):
    """Area of the patch within what the perturbation of the ring's radius allows; all on the bone's side."""
    ring = oval(off) + np.random.default_rng(seed).uniform(-jitter, jitter, (24, 3))
    ring = np.repeat(np.roll(ring, start, axis=0), repeated, axis=0)[:: -1 if backwards else 1]
    patch = attachment_patch(*SLAB, ring, True, bone_distance=beneath).points
    x, y, z = SLAB[0][patch].T
    assert (z == 0.0).all()
    slack = 3.0 + jitter
    assert (np.hypot(x / (15 + slack), y / (8 + slack)) <= 1.0).all()
    core = (SLAB[0][:, 2] == 0.0) & (
        np.hypot(SLAB[0][:, 0] / (15 - slack), SLAB[0][:, 1] / (8 - slack)) < 1.0
    )
    assert np.isin(np.flatnonzero(core), patch).all()


def test_an_open_curve_gives_the_points_within_the_tolerance():
    meridian = latitude_ring(90.0, n=24)[:7]  # a quarter of the equator
    patch = attachment_patch(*BALL, meridian, False, tolerance=3.0).points
    assert (np.abs(BALL[0][patch][:, 2]) <= 3.0 + EDGE).all()
    x, y, z = BALL[0].T
    assert np.isin(np.flatnonzero((np.abs(z) < 3.0 - EDGE) & (x > 0) & (y > 0)), patch).all()
    wider = attachment_patch(*BALL, meridian, False, tolerance=6.0).points
    assert np.isin(patch, wider).all()
    assert len(wider) > 1.5 * len(patch)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("n", [1, 2, 3])
def test_points_and_landmarks_on_a_line_are_an_open_curve(closed, n):
    line = np.array([[0.0, 0.0, 23.0], [5.0, 0.0, 23.0], [10.0, 0.0, 23.0]])[:n]
    patch = attachment_patch(*BALL, line, closed).points
    assert len(patch)
    np.testing.assert_array_equal(patch, attachment_patch(*BALL, line, False).points)
    assert np.linalg.norm(BALL[0][patch][:, None] - BALL[0][None, patch], axis=2).max() < 13.0 + 2 * EDGE


def test_the_other_face_of_a_thin_muscle_is_left_alone():
    n = 21
    flat, sheet = grid(n - 1, n - 1)
    points = np.vstack([flat, np.add(flat, [0.0, 0.0, 0.5])])
    rim = np.concatenate(
        [np.arange(n), np.arange(n) * n + n - 1, np.arange(n) * n, np.arange(n) + n * (n - 1)]
    )
    side = np.column_stack([rim[:-1], rim[1:], rim[:-1] + n * n])
    triangles = np.vstack([sheet, sheet[:, ::-1] + n * n, side])
    curve = np.array([[6.0, 10.0, -1.0], [14.0, 10.0, -1.0]])
    patch = attachment_patch(points, triangles, curve, False, tolerance=2.0).points
    assert len(patch) > 20
    assert (points[patch][:, 2] == 0.0).all()


def test_a_larger_distance_takes_landmarks_that_are_farther_away():
    """15 mm off a ball whose box has a diagonal of 69 mm, of which a fifth is accepted."""
    ring = latitude_ring(40.0, radius=RADIUS + 15.0)
    with pytest.raises(ValueError, match=r"from the muscle"):
        attachment_patch(*BALL, ring, True)
    patch = attachment_patch(*BALL, ring, True, tolerance=16.0).points
    np.testing.assert_array_equal(
        patch, attachment_patch(*BALL, latitude_ring(40.0), True, tolerance=16.0).points
    )


def test_landmarks_on_unconnected_pieces_are_refused():
    points = np.vstack([BALL[0], BALL[0] + [50.0, 0.0, 0.0]])
    triangles = np.vstack([BALL[1], BALL[1] + len(BALL[0])])
    across = np.array([[0.0, 0.0, 20.0], [50.0, 0.0, 20.0]])
    with pytest.raises(ValueError, match="separate pieces"):
        attachment_patch(points, triangles, across, False)
