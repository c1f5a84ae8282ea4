import numpy as np
import pytest

from vtkmuscle.core.template import KINDS, TEMPLATES, sobol_points
from vtkmuscle.data.arrays import cell_array, field_array, point_array, polylines_of
from vtkmuscle.filters.fibre_template_source import FibreTemplateSource


@pytest.mark.parametrize("kind", KINDS)
def test_fibres_are_those_of_the_template(kind):
    fibres = FibreTemplateSource(template=kind, n_fibres=7, resolution=4).update().output
    lines, t = polylines_of(fibres, "test"), point_array(fibres, "t", "test")
    r, s = (cell_array(fibres, name, "test") for name in ("r", "s"))
    assert np.array_equal(np.column_stack([r, s]), sobol_points(7))
    assert np.array_equal(lines.offsets, np.arange(0, 36, 5))
    assert np.allclose(t.reshape(7, 5), np.linspace(0, 1, 5))
    expected = TEMPLATES[kind].fibres(r, s, np.linspace(0, 1, 5))
    assert np.array_equal(lines.points.reshape(7, 5, 3), expected)
    assert np.array_equal(cell_array(fibres, "FibreId", "test"), np.arange(7))


@pytest.mark.parametrize("kind", KINDS)
def test_areas_are_those_of_the_template(kind):
    fibres = FibreTemplateSource(template=kind).update().output
    for name, end in (("OriginArea", 0), ("InsertionArea", -1)):
        assert np.array_equal(field_array(fibres, name), TEMPLATES[kind].areas(end).reshape(-1, 3))


def test_many_fibres_are_the_same_ones_neighbour_after_neighbour():
    template = FibreTemplateSource(n_fibres=3000, resolution=1)()
    places = np.column_stack([cell_array(template, name, "template") for name in "rs"])
    sobol = sobol_points(3000)
    np.testing.assert_array_equal(places[np.lexsort(places.T)], sobol[np.lexsort(sobol.T)])
    steps, in_turn = (np.linalg.norm(np.diff(each, axis=0), axis=1).mean() for each in (places, sobol))
    assert steps < 0.1 * in_turn
