import numpy as np
import pytest

from vtkmuscle.core.morphing.twist import BoundaryDrift, SuperficialFibres, fitted_twist, turned_starts
from vtkmuscle.core.template.kinds import TEMPLATES

FRACTIONS = np.linspace(0.02, 0.98, 33)


def ellipses(width=20.0, depth=14.0, length=100.0):
    angle = 2 * np.pi * np.arange(90) / 90
    flat = np.column_stack([width / 2 * np.cos(angle), depth / 2 * np.sin(angle)])
    return [np.column_stack([flat, np.full(90, length * t)]) for t in FRACTIONS]


def test_a_start_moves_on_by_its_part_of_the_contour():
    square = np.array([[0.0, 0], [4, 0], [4, 4], [0, 4]])
    starts = np.tile([1.0, 0.0], (3, 1))
    moved = turned_starts([square] * 3, starts, np.array([0.0, 0.5, 1.0]), 90.0)
    assert np.allclose(moved, [[0, 1], [1, 0], [3, 0]])
    assert turned_starts([square] * 3, starts, np.array([0.0, 0.5, 1.0]), 0.0) is starts


@pytest.mark.parametrize("twist", [0.0, 33.0, -120.0, 250.0])
def test_a_twist_is_found_again_from_lines_along_the_turned_starts(twist):
    rings = ellipses()
    corner = np.array([ring[11] for ring in rings])
    lines = []
    for start in (0, 20, 40, 70):
        begun = np.array([ring[start] for ring in rings])
        lines.append(turned_starts(rings, begun, FRACTIONS, twist)[6:-6])
    steps = np.concatenate([np.diff(line, axis=0) for line in lines])
    lengths = np.linalg.norm(steps, axis=1)
    places = np.concatenate([(line[1:] + line[:-1]) / 2 for line in lines])
    for sign in (1.0, -1.0):
        seen = SuperficialFibres(places, sign * steps / lengths[:, None], lengths)
        found = fitted_twist(rings, corner, FRACTIONS, seen)
        assert found.twist == pytest.approx(twist, abs=1.0 + 0.01 * abs(twist))
        assert found.angle < 2.0
        assert found.straight_angle >= max(found.angle, 0.05 * abs(twist))


def test_fibres_across_the_muscle_find_no_twist_that_explains_them():
    rings = ellipses(length=20.0)
    places = np.array([rings[16][i] for i in range(0, 90, 10)])
    towards = np.cross(places - [0, 0, 10.0], [0, 0, 1.0])
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    towards[::2] = [0.0, 0.0, 1.0]  # half of them along it: no twist suits both
    found = fitted_twist(
        rings, np.array([r[0] for r in rings]), FRACTIONS, SuperficialFibres(places, towards, np.ones(9))
    )
    assert found.best_angle > 30
    assert (found.twist, found.angle) == (0.0, found.straight_angle)


def test_templates_drift_along_their_own_faces():
    sides = np.array([20.0, 14.0, 100.0])
    r, s = (grid.reshape(-1) for grid in np.meshgrid(np.linspace(0, 1, 21), np.linspace(0, 1, 21)))
    t = np.linspace(0.0, 1.0, 41)

    def drift(kind):
        points = (TEMPLATES[kind].fibres(r, s, t) * sides).reshape(-1, 3)
        return BoundaryDrift(points, np.arange(0, len(points) + 1, len(t)), sides)

    assert drift("parallel").straight
    arched = drift("curved")
    assert not arched.straight
    # On the front, y = 0, fibres lean towards x = 1 in the lower half, which is on along the boundary; on the
    # back as well, which is back along it; in the upper half they return.
    front, back = 10.0 / 68.0, 44.0 / 68.0
    assert arched.at(np.array([0.2]), np.array([front]))[0] > 0.02
    assert arched.at(np.array([0.2]), np.array([back]))[0] < -0.02
    assert arched.at(np.array([0.8]), np.array([front]))[0] < -0.02
    # The slope dx/dt of the fibre through the middle of the front at t = 0.2.
    x, h = np.linspace(0, 1, 2001), 1e-4
    near = TEMPLATES["curved"].fibres(x, np.zeros(2001), [0.2 - h, 0.2, 0.2 + h])
    line = near[np.abs(near[:, 1, 0] - 0.5).argmin()]
    slope = (line[2, 0] - line[0, 0]) / (2 * h) * sides[0] / 68.0
    assert arched.at(np.array([0.2]), np.array([front]))[0] == pytest.approx(slope, rel=0.1)
