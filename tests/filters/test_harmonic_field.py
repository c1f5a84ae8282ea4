import numpy as np
import pytest

from vtkmuscle.data.arrays import field_string, point_array, points_of, set_point_array, with_points
from vtkmuscle.filters.fibre_template_source import FibreTemplateSource
from vtkmuscle.filters.harmonic_field import HarmonicField
from vtkmuscle.filters.slice_morpher import SliceMorpher
from vtkmuscle.filters.template_fitter import TemplateFitter


@pytest.fixture
def iliacus(hip):
    muscle, areas = hip.muscles["iliacus"], hip.attachments["iliacus"]
    fitted = TemplateFitter()(FibreTemplateSource(n_fibres=20).update().output, muscle, areas)
    return muscle, areas, fitted


def test_the_function_runs_from_the_origin_to_the_insertion_without_another_extremum(iliacus):
    muscle, areas, _ = iliacus
    result = HarmonicField()(muscle, areas)
    field = point_array(result, "HarmonicField", "test")
    assert (field.min(), field.max()) == (0, 1)
    assert (field == 0).sum() > 5
    assert (field == 1).sum() > 5
    assert not muscle.GetPointData().HasArray("HarmonicField")


def test_the_morpher_takes_the_function_of_the_muscle_and_then_needs_no_attachments(iliacus):
    muscle, areas, fitted = iliacus
    morpher = SliceMorpher(method="harmonic")
    own = morpher(fitted, muscle, areas)
    given = SliceMorpher()(fitted, HarmonicField()(muscle, areas))
    assert field_string(given, "MorphMethod") == "harmonic"
    assert np.array_equal(points_of(own), points_of(given))


def test_a_deformed_muscle_keeps_the_function(iliacus):
    muscle, areas, fitted = iliacus
    rest = HarmonicField()(muscle, areas)
    bent = with_points(rest, points_of(rest) * [1.0, 1.0, 1.05])
    fibres = SliceMorpher(method="harmonic")(fitted, bent)
    assert np.isfinite(points_of(fibres)).all()


def test_a_wrong_function_is_refused(iliacus):
    muscle, areas, fitted = iliacus
    wrong = HarmonicField()(muscle, areas)
    set_point_array(wrong, "HarmonicField", 2 * point_array(wrong, "HarmonicField", "test"))
    with pytest.raises(ValueError, match="'HarmonicField' must have one number in"):
        SliceMorpher(method="harmonic")(fitted, wrong)
