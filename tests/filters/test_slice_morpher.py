import numpy as np
import pytest
from oracles import igl
from phantoms import fibre_block
from shapes import lines_of, turns_of
from slow import slow

from vtkmuscle import Scene
from vtkmuscle.data.arrays import field_array, field_string, points_of, polylines_of, triangles_of
from vtkmuscle.filters.fibre_template_source import FibreTemplateSource
from vtkmuscle.filters.slice_morpher import SliceMorpher
from vtkmuscle.filters.template_fitter import TemplateFitter
from vtkmuscle.io import read_polydata


def fitted_to(muscle, attachments, kind="parallel", n_fibres=30, resolution=15):
    template = FibreTemplateSource(template=kind, n_fibres=n_fibres, resolution=resolution).update().output
    return TemplateFitter()(template, muscle, attachments)


def fibres_in(muscle, attachments, **template):
    fibres = SliceMorpher()(fitted_to(muscle, attachments, **template), muscle, attachments)
    return fibres, polylines_of(fibres, "test")


def share_inside(points, muscle, slack):
    surface, triangles = points_of(muscle), triangles_of(muscle, "test")
    distances = np.sqrt(igl.point_mesh_squared_distance(points, surface, triangles)[0])
    return ((igl.fast_winding_number(surface, triangles, points) > 0.5) | (distances <= slack)).mean()


def largest_turns(lines):
    """Return the largest angle between successive segments of each fibre, its end segments left out."""
    return np.array([turns_of(lines.line(i)[1:-1]).max() for i in range(len(lines))])


def test_fibres_are_inside_of_the_phantoms_and_run_along_them(hip):
    for name, muscle in hip.muscles.items():
        _, lines = fibres_in(muscle, hip.attachments[name])
        assert share_inside(lines.points, muscle, 0.5) > 0.95, name
        assert np.median(largest_turns(lines)) < 45, name


def test_a_bent_muscle_is_followed_along_isolines_and_planes_say_that_they_cannot(hip):
    muscle, areas = hip.muscles["iliacus"], hip.attachments["iliacus"]
    fitted = fitted_to(muscle, areas)
    followed = SliceMorpher()(fitted, muscle, areas)
    assert field_string(followed, "MorphMethod") == "harmonic"
    with pytest.warns(UserWarning, match="bent too much for parallel planes"):
        by_planes = SliceMorpher(method="plane")(fitted, muscle, areas)
    with pytest.warns(UserWarning, match="bent too much for parallel planes"):
        without_attachments = SliceMorpher()(fitted, muscle)
    assert np.array_equal(points_of(by_planes), points_of(without_attachments))
    assert field_array(by_planes, "SteepShare") > 0.15
    assert field_array(followed, "SteepShare") == field_array(by_planes, "SteepShare")
    # Planes gather all fibres at the muscle's ends, isolines spread them over the areas.
    starts = [points_of(f)[::16] for f in (followed, by_planes)]
    assert starts[0].std(axis=0).max() > 5 * starts[1].std(axis=0).max()


def test_the_harmonic_method_needs_an_upright_template(block):
    muscle, areas = block.muscles["block"], block.attachments["block"]
    with pytest.raises(ValueError, match="areas at bottom and top"):
        SliceMorpher(method="harmonic")(fitted_to(muscle, areas, kind="pennate"), muscle, areas)


@pytest.mark.realdata
@pytest.mark.parametrize("name", [*slow("gluteus_maximus", "gluteus_medius"), "iliacus", "adductor_brevis"])
def test_fibres_of_real_muscles_are_inside_and_do_not_zigzag(lhdl_hip, name):
    scene = Scene.load(lhdl_hip / "scene.toml")
    muscle = scene.muscles[name].surface
    _, lines = fibres_in(muscle, scene.attachments_data(name), n_fibres=100)
    assert np.isfinite(lines.points).all()
    assert share_inside(lines.points, muscle, 0.5) >= 0.98
    assert np.percentile(largest_turns(lines), 90) < 60


# ------------------------------------------------------------------------------- superficial fibres


@pytest.mark.parametrize("method", ["plane", "harmonic"])
def test_the_angle_to_superficial_fibres_is_reported(method):
    block = fibre_block("parallel")
    chain = block.muscles["block"], block.attachments["block"]
    fitted, z = fitted_to(*chain), np.linspace(30.0, 90.0, 5)
    lines = [np.column_stack([x + slope * (z - 60.0), 0.0 * z, z]) for slope, x in ((0.1, 8.0), (-0.1, 12.0))]
    fibres = SliceMorpher(method=method)(fitted, *chain, lines_of(lines))
    assert field_array(fibres, "SuperficialAngle")[0] == pytest.approx(np.degrees(np.arctan(0.1)), abs=0.2)
    alone = SliceMorpher(method=method)(fitted, *chain)
    assert field_array(alone, "SuperficialAngle") is None
    assert np.array_equal(points_of(alone), points_of(fibres))


@pytest.mark.realdata
@pytest.mark.gap("angle of fibres by planes to dissected fibres, gluteus maximus", "31 degrees", "30 degrees")
@pytest.mark.parametrize(("method", "largest"), [("plane", 32), ("harmonic", 30)])
def test_dissected_fibres_that_deviate_are_warned_of(method, largest, lhdl_hip):
    scene = Scene.load(lhdl_hip / "scene.toml")
    muscle, attachments = scene.muscles["gluteus_maximus"].surface, scene.attachments_data("gluteus_maximus")
    seen = read_polydata(lhdl_hip / "fibres_dissection/gluteus_maximus_superficial.vtp")
    fitted = TemplateFitter()(FibreTemplateSource()(), muscle, attachments, seen)
    with pytest.warns(UserWarning, match="superficial fibres deviate by"):
        fibres = SliceMorpher(method=method)(fitted, muscle, attachments, seen)
    assert 10 < field_array(fibres, "SuperficialAngle")[0] < largest
