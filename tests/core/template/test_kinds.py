import warnings

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.interpolate import BPoly

from vtkmuscle.core.template.kinds import KINDS, TEMPLATES, bezier, sobol_points

unit = st.floats(0.0, 1.0)


@pytest.fixture(params=KINDS)
def template(request):
    return TEMPLATES[request.param]


@settings(deadline=None, max_examples=40)
@given(r=unit, s=unit)
@example(r=0.23435028491676452, s=0.125)  # the weights of the corners add up to a little more than 1
def test_fibres_stay_in_the_cube_and_climb(r, s):
    for template in TEMPLATES.values():
        points = template.fibres([r], [s], np.linspace(0, 1, 30))[0]
        assert points.min() >= 0.0
        assert points.max() <= 1.0
        assert (np.diff(points[:, 2]) > 0.0).all()


def test_fibres_begin_on_the_origin_area_and_end_on_the_insertion_area(template, rng):
    r, s = rng.random((2, 200))
    ends = template.fibres(r, s, [0.0, 1.0])
    part = np.minimum((r * len(template.parts)).astype(int), len(template.parts) - 1)
    for end, areas in ((0, template.origin_areas), (1, template.insertion_areas)):
        for area, points in ((areas[i], ends[part == i, end]) for i in range(len(areas))):
            # A parallelogram: corners 1 and 3 span it from corner 0.
            assert np.allclose(area[0] + area[2], area[1] + area[3])
            across = np.column_stack([area[1] - area[0], area[3] - area[0]])
            found, *_ = np.linalg.lstsq(across, (points - area[0]).T, rcond=None)
            assert np.allclose(across @ found, (points - area[0]).T, atol=1e-14)
            assert found.min() >= -1e-14
            assert found.max() <= 1 + 1e-14


def test_origin_is_at_the_bottom_and_insertion_at_the_top_except_for_aponeuroses(template):
    if len(template.parts) == 1 and np.ptp(template.origin_areas[..., 2]) == 0.0:
        assert (template.origin_areas[..., 2] == 0.0).all()
        assert (template.insertion_areas[..., 2] == 1.0).all()
    else:
        assert template.origin_areas[..., 2].max() <= template.insertion_areas[..., 2].min()


@pytest.mark.parametrize(("kind", "width"), [("pennate", 1.0), ("bipennate", 0.5)])
def test_pennate_fibres_are_straight_parallel_and_equally_long(kind, width, rng):
    r, s = rng.random((2, 50)) * [[0.5], [1.0]]
    points = TEMPLATES[kind].fibres(r, s, np.linspace(0, 1, 7))
    assert np.allclose(np.diff(points, axis=1), np.array([width, 0.0, 0.5]) / 6, atol=1e-14)


@settings(deadline=None, max_examples=30)
@given(degree=st.integers(1, 4), seed=st.integers(0, 1000))
def test_bezier_agrees_with_scipy(degree, seed):
    rng = np.random.default_rng(seed)
    polygons, t = rng.random((3, degree + 1, 3)), rng.random(5)
    expected = [BPoly(polygon[:, None, :], [0, 1])(t) for polygon in polygons]
    assert np.allclose(bezier(polygons, t), expected, atol=1e-14)


@pytest.mark.parametrize("n", [1, 2, 3, 100, 128, 1000])
def test_any_number_of_sobol_points_without_a_warning(n):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        points = sobol_points(n)
    assert points.shape == (n, 2)
    assert points.min() > 0.0
    assert points.max() < 1.0
    assert np.array_equal(points, sobol_points(n))


def test_a_power_of_two_of_sobol_points_puts_one_in_each_cell():
    cells = np.floor(sobol_points(64) * [8, 8]).astype(int)
    assert len(np.unique(cells, axis=0)) == 64
    assert np.allclose(np.sort(sobol_points(64), axis=0), (np.arange(64)[:, None] + 0.5) / 64)
