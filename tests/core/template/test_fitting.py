import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shapes import rigid

from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.template import (
    TEMPLATES,
    SuperficialFibres,
    angle_to_nearest,
    areas_are_opposite,
    centroid_axis,
    fit_box,
    principal_axis,
    superficial_pieces,
)

SIDES = np.array([20.0, 40.0, 120.0])
PARALLEL = (TEMPLATES["parallel"].areas(0).reshape(-1, 3), TEMPLATES["parallel"].areas(-1).reshape(-1, 3))


def block(n=6):
    """Return points on the surface of a block of the sides above, its corners among them."""
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, n)] * 3), axis=-1).reshape(-1, 3)
    return grid[((grid == 0) | (grid == 1)).any(axis=1)] * SIDES


def cloud(seed):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(60, 3)) * [5.0, 9.0, 30.0], rng


def rectangle(low, high):
    return np.array([(low[0], low[1], low[2]), (high[0], low[1], low[2]), high, (low[0], high[1], high[2])])


def fit(points, origin, insertion, axis=None, angle_step=5.0, areas=PARALLEL):
    axis = centroid_axis(origin, insertion) if axis is None else axis
    return fit_box(points, axis, landmarks=(origin, insertion), areas=areas, angle_step=angle_step)


def ends(points):
    """Return landmarks at both ends of a muscle along z."""
    return points[np.argsort(points[:, 2])[:8]], points[np.argsort(points[:, 2])[-8:]]


def test_a_block_is_met_exactly():
    points = block()
    for seed in range(4):
        moved = apply_transform(rigid(np.random.default_rng(seed)), points)
        found = fit(moved, moved[points[:, 2] == 0], moved[points[:, 2] == SIDES[2]])
        assert np.allclose(np.sort(np.linalg.norm(found.transform[:3, :3], axis=0)), SIDES, atol=1e-9)
        # The template's corners are points of the block.
        assert found.error < 1e-9


@pytest.mark.parametrize("flip", [(1, 1), (-1, -1)])
def test_aponeuroses_lie_on_the_template_faces_that_are_nearest_to_them(flip):
    """Turned by half a turn about the long axis, the box turns with the attachments."""
    points = block() - SIDES / 2
    w, d, length = SIDES / 2
    turn = np.diag([*flip, 1.0])
    origin = rectangle((-w, -d, -length), (-w, d, 0)) @ turn
    insertion = rectangle((w, -d, 0), (w, d, length)) @ turn
    pennate = TEMPLATES["pennate"]
    areas = pennate.areas(0)[0], pennate.areas(-1)[0]
    found = fit(points, origin, insertion, axis=np.array([0.0, 0, 1]), areas=areas)
    across = found.transform[:3, 0] / np.linalg.norm(found.transform[:3, 0])
    assert np.allclose(across, [flip[0], 0, 0], atol=1e-9)


def test_principal_axis_is_the_long_one_and_points_to_the_insertion():
    points = block() - SIDES / 2
    top, bottom = np.array([[0.0, 0, 50]]), np.array([[0.0, 0, -50]])
    assert np.allclose(principal_axis(points, bottom, top), [0, 0, 1])
    assert np.allclose(principal_axis(points, top, bottom), [0, 0, -1])


def test_coinciding_centroids_are_refused():
    ring = np.array([(1.0, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)])
    with pytest.raises(ValueError, match="axis='principal'"):
        centroid_axis(ring, 2 * ring)
    with pytest.raises(ValueError, match="coincide"):
        centroid_axis(ring[:1], ring[:1])


@pytest.mark.parametrize("flat", [0, 2])
def test_a_flat_muscle_is_refused(flat):
    points = block() @ Rotation.from_euler("z", 0.3).as_matrix()
    points[:, flat] = 7.0
    with pytest.raises(ValueError, match="one plane"):
        fit(points, points[:2], points[2:4], axis=np.array([0.0, 0, 1]))


@pytest.mark.parametrize("kind", list(TEMPLATES))
def test_only_areas_at_bottom_and_top_lie_opposite(kind):
    areas = (TEMPLATES[kind].areas(0).reshape(-1, 3), TEMPLATES[kind].areas(-1).reshape(-1, 3))
    assert areas_are_opposite(*areas) == (kind not in {"pennate", "bipennate"})


def test_pieces_share_out_their_fibres():
    lines = np.array([[0.0, 0, 0], [0, 0, 10], [5, 0, 0], [5, 0, 0], [5, 3, 0]])
    seen = superficial_pieces(lines, np.array([0, 2, 5]), np.array([[0.0, 0, -50], [0, 0, 50]]))
    assert seen.lengths.sum() == pytest.approx(13.0)
    assert seen.lengths.max() <= 2.0
    assert np.allclose(np.abs(seen.directions @ [0, 0, 1]).round(12) @ seen.lengths, 10.0)
    assert np.allclose(seen.middles[:5], [[0, 0, z] for z in (1, 3, 5, 7, 9)])
    with pytest.raises(ValueError, match="all fibres have length 0"):
        superficial_pieces(lines[2:4], np.array([0, 2]), lines)


def test_angles_have_no_sign_and_the_longer_pieces_count_more():
    places = np.arange(4.0)[:, None] * [10.0, 0, 0]
    ways = np.array([[-3.0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0]])
    others = np.stack([places - ways / 2, places + ways / 2], axis=1).reshape(-1, 3)
    for i, angle in enumerate((0, 90, 45, 0)):
        one = SuperficialFibres(places[[i]], np.eye(3)[[0]], np.ones(1))
        assert np.degrees(angle_to_nearest(one, others, np.arange(0, 9, 2))) == pytest.approx(angle)
    two = SuperficialFibres(places[[0, 1]], np.eye(3)[[0, 0]], np.array([3.0, 1.0]))
    assert np.degrees(angle_to_nearest(two, others, np.arange(0, 9, 2))) == pytest.approx(np.sqrt(90**2 / 4))


def test_the_angle_to_others_is_that_to_the_nearest_of_them():
    seen = SuperficialFibres(np.array([[0.0, 0, 0], [10, 0, 0]]), np.eye(3)[[0, 0]], np.ones(2))
    others = np.array([[-1.0, 0, 1], [1, 0, 1], [9, -1, 0], [11, 1, 0]])
    angle = angle_to_nearest(seen, others, np.array([0, 2, 4]))
    assert np.degrees(angle) == pytest.approx(np.sqrt(45**2 / 2))
