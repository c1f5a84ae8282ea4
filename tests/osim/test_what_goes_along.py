"""What goes along with exported paths: Hill's parameters, meshes, masses; and what is refused."""

import numpy as np
import osim_texts as texts
import pytest
from two_joint_scene import save_strap, scene_with
from typer.testing import CliRunner

from vtkmuscle import InputError, Result, Scene, SceneError
from vtkmuscle.cli import app
from vtkmuscle.io import read_surface
from vtkmuscle.opensim import read_osim, write_mujoco, write_opensim
from vtkmuscle.opensim.export_parts import SPECIFIC_TENSION, completed_properties

GRID = {"grid": {"upper": [-10, 30, 10], "lower": [0, 40, 10]}}
ARCHITECTURE = {
    "fascicle_length_mm": {"mean": 80.0},
    "fascicle_pennation_origin_deg": {"mean": 10.0},
    "fascicle_pennation_insertion_deg": {"mean": 20.0},
    "pcsa_without_tendon_mm2": 1500.0,
}


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """A scene of a strap over two joints, and the folder of its results."""
    folder = tmp_path_factory.mktemp("strap")
    save_strap(folder, n_fibres=10)
    path = scene_with(folder, tmp_path_factory.mktemp("joints"), motion=GRID, deformer="none")
    Scene.load(path).run(path.parent / "results", figures=False)
    return path, path.parent / "results"


def test_properties_are_those_of_the_architecture():
    found = completed_properties({}, ARCHITECTURE, "m", length=0.3)
    assert found == pytest.approx(
        {
            "max_isometric_force": SPECIFIC_TENSION * 15.0,
            "optimal_fiber_length": 0.08,
            "pennation_angle_at_optimal": np.radians(15.0),
            "tendon_slack_length": 0.3 - 0.08 * np.cos(np.radians(15.0)),
        }
    )


def test_sarcomeres_make_another_length_optimal_and_leave_the_tendon_as_it_is():
    stretched = ARCHITECTURE | {"fascicle_length_normalised_mm": 60.0}
    plain, found = (completed_properties({}, one, "m", length=0.3) for one in (ARCHITECTURE, stretched))
    assert found["optimal_fiber_length"] == pytest.approx(0.06)
    assert found["tendon_slack_length"] == pytest.approx(plain["tendon_slack_length"])
    thick = 0.08 * np.sin(np.radians(15.0))  # the muscle's thickness stays
    assert 0.06 * np.sin(found["pennation_angle_at_optimal"]) == pytest.approx(thick)


def test_what_is_given_stays_and_the_tendon_fits_it():
    given = {"optimal_fiber_length": 0.1, "max_isometric_force": 700.0, "pennation_angle_at_optimal": 0.0}
    found = completed_properties(given, ARCHITECTURE, "m", length=0.3)
    assert found == pytest.approx(given | {"tendon_slack_length": 0.2})
    with pytest.raises(
        ValueError, match=r"'m' has a path of 70 mm and fibres of 80 mm at rest.*geometry only"
    ):
        completed_properties({}, ARCHITECTURE, "m", length=0.07)


def test_results_are_exported_without_another_run(ran, tmp_path, monkeypatch):
    path, results = ran
    monkeypatch.setattr(Scene, "run", lambda *_args, **_options: pytest.fail("it was run"))
    (found,) = write_opensim(results, tmp_path / "strap.osim")
    muscle = read_osim(tmp_path / "strap.osim").muscle("strap")
    known = Result.load(results).report["muscles"]["strap"]["architecture"]
    assert muscle.parameters["optimal_fiber_length"] == pytest.approx(
        known["fascicle_length_mm"]["mean"] / 1000
    )
    force = SPECIFIC_TENSION * known["pcsa_without_tendon_mm2"] / 100.0
    assert muscle.parameters["max_isometric_force"] == pytest.approx(force)
    (other,) = write_opensim(results, tmp_path / "other.osim", specific_tension=2.0 * SPECIFIC_TENSION)
    assert other.out.parameters["max_isometric_force"] == pytest.approx(2.0 * force)
    rest = found.out.path.lengths(read_osim(tmp_path / "strap.osim").tree, {"upper": [0.0], "lower": [0.0]})[
        0
    ]
    along = muscle.parameters["optimal_fiber_length"] * np.cos(
        muscle.parameters["pennation_angle_at_optimal"]
    )
    assert along + muscle.parameters["tendon_slack_length"] == pytest.approx(rest, abs=1e-6)
    kept = path.read_text()
    path.write_text(kept + "\n# changed\n")
    with pytest.raises(ValueError, match="has changed"):
        write_opensim(results, tmp_path / "strap.osim")
    path.write_text(kept)


def test_meshes_lie_on_their_bodies(ran, tmp_path):
    path, results = ran
    write_opensim(results, tmp_path / "strap.osim", masses={"middle": 3.0})
    scene = Scene.load(path)
    model = read_osim(tmp_path / "strap.osim")
    assert {(one.body, one.file) for one in model.meshes} == {
        *((bone, f"{bone}.stl") for bone in scene.bones if bone != "proximal"),
        *((body, f"{name}.stl") for body, name in (("proximal", "proximal"), ("proximal", "strap_at_rest"))),
    }
    poses = model.tree.poses({})
    for one in model.meshes:
        surface = read_surface(tmp_path / "Geometry" / one.file)
        pose = poses[one.body][0]
        bounds = np.array(surface.GetBounds()).reshape(3, 2).T @ pose[:3, :3].T + pose[:3, 3]
        name = one.file.removesuffix(".stl").removesuffix("_at_rest")
        known = scene.bones[name] if name in scene.bones else scene.muscles[name].surface
        np.testing.assert_allclose(1000.0 * bounds, np.array(known.GetBounds()).reshape(3, 2).T, atol=1e-2)
    text = (tmp_path / "strap.osim").read_text()
    assert text.count("<mass>0.0</mass>") == len(model.tree.bodies) - 2
    assert text.count("<mass>3.0</mass>") == 1


def test_a_coordinate_that_is_crossed_and_still_is_named_before_anything_is_run(ran, tmp_path, monkeypatch):
    path, _ = ran
    monkeypatch.setattr(Scene, "run", lambda *_args, **_options: pytest.fail("it was run"))
    still = scene_with(path.parent, tmp_path, motion={"grid": {"upper": [-10, 30, 10]}}, deformer="none")
    with pytest.raises(SceneError, match="does not move lower, crossed by muscle 'strap'"):
        write_opensim(still, tmp_path / "strap.osim")


def test_an_old_model_is_refused_before_anything_is_run(ran, tmp_path, monkeypatch):
    path, _ = ran
    monkeypatch.setattr(Scene, "run", lambda *_args, **_options: pytest.fail("it was run"))
    (tmp_path / "old.osim").write_bytes(texts.model_3().encode("latin-1"))
    with pytest.raises(ValueError, match="version 30000"):
        write_opensim(path, tmp_path / "new.osim", into=tmp_path / "old.osim")


def test_a_model_of_another_leg_is_refused_in_words(ran, tmp_path):
    _, results = ran
    (tmp_path / "leg.osim").write_text(texts.model_4(forces=texts.muscle("")))
    with pytest.raises(InputError, match=r"has no coordinate 'upper'; use the model's names .* hip_x, "):
        write_opensim(results, tmp_path / "new.osim", into=tmp_path / "leg.osim")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--mass", "middle=-3"], "no mass"),
        (["--mass", "middle"], "no pair"),
        (["--mass", "nobody=3"], "no body 'nobody'"),
    ],
)
def test_a_mass_that_is_none_is_told(ran, tmp_path, words, said):
    call = CliRunner().invoke(app, ["export", str(ran[1]), str(tmp_path / "a.osim"), *words])
    assert call.exit_code != 0
    assert said in " ".join(call.output.split())


def test_geometry_alone_has_no_properties(ran, tmp_path):
    _, results = ran
    said = CliRunner().invoke(app, ["export", str(results), str(tmp_path / "a.osim"), "--geometry-only"])
    assert said.exit_code == 0, said.output
    muscle = read_osim(tmp_path / "a.osim").muscle("strap")
    assert (muscle.kind, muscle.parameters) == ("PathActuator", {})


def test_mujoco_gets_muscles_of_the_same_lengths(ran, tmp_path):
    mujoco = pytest.importorskip("mujoco", reason="the extra mujoco is not installed")
    _, results = ran
    (found,) = write_mujoco(results, tmp_path / "strap.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "strap.xml"))
    assert (model.nu, model.nmesh) == (1, 4)
    low, high = model.actuator_lengthrange[0]
    first, last = model.actuator_gainprm[0][:2]
    along = (high - low) / (last - first)  # as MuJoCo has it
    properties = found.out.parameters
    cosine = np.cos(properties["pennation_angle_at_optimal"])
    assert along == pytest.approx(properties["optimal_fiber_length"] * cosine)
    assert low - first * along == pytest.approx(properties["tendon_slack_length"])
    assert model.actuator_gainprm[0][2] == pytest.approx(properties["max_isometric_force"] * cosine)
