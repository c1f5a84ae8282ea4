"""Hill's parameters in exports, sliding coordinates in metres, and moment arms by what a muscle crosses."""

import tomllib

import numpy as np
import pytest
import tomli_w
from phantoms.two_joint_strap import ARMS
from tiny_scene import write_tiny_scene
from two_joint_scene import save_strap, scene_with

from vtkmuscle import Scene, SceneError
from vtkmuscle.opensim import export, read_osim

HILL = {"optimal_fibre_length": 50.0, "pennation": 30.0, "pcsa": 18.0, "specific_tension": 61.0}
SLIDE = {
    "parent": "upper",
    "child": "lower",
    "type": "custom",
    "centre": [0.0, -15.0, 0.0],
    "coordinates": {"slide": {}},
    "translations": [{"axis": [0.0, 0.0, -1.0], "coordinate": "slide"}],
}


def sliding(tmp_path, **muscle):
    """Write a spindle that is drawn out along its axis by a slide, 0 to 12 mm; return the scene's file."""
    path = write_tiny_scene(tmp_path / "scene")
    tables = tomllib.loads(path.read_text())
    tables |= {"joints": {"pull": SLIDE}, "motion": {"grid": {"slide": [0, 12, 2]}}, "deformer": "none"}
    del tables["solver"]  # no muscle is solved
    tables["muscles"]["spindle"] |= muscle
    path.write_text(tomli_w.dumps(tables))
    return path


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """The file and the result of the spindle on a slide, with Hill's parameters."""
    path = sliding(tmp_path_factory.mktemp("slide"), hill=HILL)
    return path, Scene.load(path).run(figures=False)


@pytest.mark.parametrize("form", ["functions", "points"])
def test_slides_are_exported_in_metres(drawn, tmp_path, form):
    result = drawn[1]
    (found,) = export(result, tmp_path / "drawn.osim", form=form)
    model = read_osim(tmp_path / "drawn.osim")
    slide = {"slide": 0.001 * np.arange(0.0, 13.0, 2.0)}
    lengths = 1000.0 * model.muscle("spindle").path.lengths(model.tree, slide)
    known = result.lengths["spindle"].mean(axis=1)
    assert np.ptp(known) == pytest.approx(12.0, abs=1.0)
    np.testing.assert_allclose(np.diff(lengths), np.diff(known), atol=0.1)
    assert np.abs(found.errors["length"]).max() < 0.3


def test_groups_share_the_force_and_what_is_asked_for_counts_more(drawn, tmp_path):
    result = drawn[1]
    asked = {"spindle": {"optimal_fiber_length": 0.06}}
    groups = export(result, tmp_path / "two.osim", groups=2, parameters=asked)
    assert sum(one.out.parameters["max_isometric_force"] for one in groups) == pytest.approx(18.0 * 61.0)
    assert {one.out.parameters["optimal_fiber_length"] for one in groups} == {0.06}


@pytest.mark.parametrize(
    ("hill", "words"),
    [
        ({"pcsa": 18.0}, "pcsa alone gives no force; give pcsa and specific_tension"),
        ({"pcsa": 18.0, "specific_tension": 61.0, "max_isometric_force": 900.0}, "cannot be combined"),
        ({"pennation": 95.0}, "less than 90"),
    ],
    ids=["half", "twice", "angle"],
)
def test_what_makes_no_muscle_is_told(tmp_path, hill, words):
    with pytest.raises(SceneError, match=words):
        Scene.load(sliding(tmp_path, hill=hill))


def test_a_saved_scene_keeps_them(drawn, tmp_path):
    path, _ = drawn
    again = Scene.load(Scene.load(path).save(tmp_path / "saved"))
    assert dict(again.muscles["spindle"].hill) == HILL
    assert again.muscles["spindle"].crosses == ("slide",)


@pytest.fixture(scope="module")
def strap_folder(tmp_path_factory):
    """The scene of a strap over two joints."""
    return save_strap(tmp_path_factory.mktemp("strap")).parent


def test_moment_arms_are_by_the_coordinates_that_a_muscle_crosses(strap_folder, tmp_path_factory):
    # Both joints move together: the scene has the joints, so that each coordinate has its own moment arms.
    walk = "inDegrees=yes\nendheader\ntime upper lower\n"
    walk += "".join(f"{i} {4 * i} {6 * i}\n" for i in range(5))
    muscles = tomllib.loads((strap_folder / "scene.toml").read_text())["muscles"]
    results = []
    for crosses in (None, ["lower"]):
        muscles["strap"] |= {} if crosses is None else {"crosses": crosses}
        folder = tmp_path_factory.mktemp("walk")
        path = scene_with(strap_folder, folder, motion={"file": "walk.mot"}, deformer="none", muscles=muscles)
        (path.parent / "walk.mot").write_text(walk)
        scene = Scene.load(path)
        assert scene.muscles["strap"].crosses == tuple(crosses or ("upper", "lower"))
        results.append(scene.run(figures=False).moment_arms()["strap"])
    both, lower = results
    assert (set(both), set(lower)) == ({"upper", "lower"}, {"lower"})
    np.testing.assert_allclose(lower["lower"].arms, both["lower"].arms, rtol=1e-12)
    np.testing.assert_allclose(both["lower"].mean, -ARMS[1], rtol=0.05)
    np.testing.assert_allclose(both["upper"].mean, ARMS[0], rtol=0.03)


def test_a_coordinate_that_is_crossed_and_not_there_is_told(strap_folder, tmp_path):
    muscles = tomllib.loads((strap_folder / "scene.toml").read_text())["muscles"]
    muscles["strap"]["crosses"] = ["lowr"]
    path = scene_with(
        strap_folder, tmp_path, motion={"grid": {"lower": [0, 20, 10]}}, deformer="none", muscles=muscles
    )
    with pytest.raises(SceneError, match="did you mean 'lower'"):
        Scene.load(path)
