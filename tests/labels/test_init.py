"""Scenes drawn up from meshes and landmarks: the phantom hip, written as people have it."""

import csv
import re
from dataclasses import replace

import numpy as np
import pytest
import pyvista as pv
from browser import Page, needs_chromium
from commands import refused, vtkmuscle_
from vtkmodules.vtkIOGeometry import vtkSTLWriter

import vtkmuscle
from vtkmuscle.core.mesh.surface import survey
from vtkmuscle.data import arrays
from vtkmuscle.data.anatomy import published
from vtkmuscle.io import read_surface
from vtkmuscle.io.writing import write_polydata
from vtkmuscle.labels.architecture import areas_at_tips
from vtkmuscle.labels.draft import Draft
from vtkmuscle.labels.guesses import guessed_joints
from vtkmuscle.phantoms import hip
from vtkmuscle.scene.sense import check_sense

HIP = hip(detail=0.5)
METRES = 1e-3


#: A joint of a drafted scene that no muscle crosses.
KNEE = (
    '[bones.shank]\nsurface = "Femur R.vtp"\n[joints.knee]\nparent = "femur_right"\nchild = "shank"\n'
    'type = "pin"\ncentre = [0, 0, 0]\naxis = [1, 0, 0]\ncoordinates = { knee_flexion = {} }\n'
)


@pytest.fixture
def files(tmp_path):
    """A hip in metres, called by names of one's own; landmarks of one area."""
    parts = {"Pelvis": HIP.bones.GetBlock(0), "Femur R": HIP.bones.GetBlock(1)}
    parts |= {"Gluteus medius R": HIP.muscles["gluteus_medius"], "iliacus_r": HIP.muscles["iliacus"]}
    written = []
    for name, part in parts.items():
        written.append(tmp_path / f"{name}.vtp")
        write_polydata(written[-1], arrays.with_points(part, METRES * arrays.points_of(part)))
    ring = METRES * arrays.points_of(dict(arrays.blocks_of(HIP.attachments["iliacus"]))["origin_0"])[:-1]
    written.append(tmp_path / "iliacus_r_origin.csv")
    np.savetxt(written[-1], ring, delimiter=",")
    return written


def init(*arguments, status=0):
    return vtkmuscle_("init", *arguments, status=status)


def test_a_scene_is_drawn_up_that_runs(files, tmp_path):
    (tmp_path / "deep/er").mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "deep/er")
    init(*files, "--out", tmp_path / "link/scene (1)")
    scene = vtkmuscle.Scene.load(tmp_path / "link/scene (1)/scene.toml")
    assert (scene.units, scene.name) == ("m", "scene 1")
    assert sorted(scene.bones) == ["femur_right", "pelvis"]
    areas = {name: {area.role: area for area in muscle.attachments} for name, muscle in scene.muscles.items()}
    found = {(role, area.bone) for each in areas.values() for role, area in each.items()}
    assert found == {("origin", "pelvis"), ("insertion", "femur_right")}
    assert not areas["iliacus_right"]["origin"].estimated
    assert areas["iliacus_right"]["origin"].closed
    assert areas["gluteus_medius_right"]["origin"].estimated
    # The head of the phantom is a ball about the origin, but for its neck.
    assert scene.motion.centre_of("femur_right") == pytest.approx([0, 0, 0], abs=1.0 * METRES)
    forward = scene.motion.at(60.0)["femur_right"] @ [0, 0, -1, 0]
    assert forward[:3] == pytest.approx([0, -np.sin(np.radians(60)), -0.5], abs=0.01)
    result = replace(scene, deformer="none").run(frames="0:2")
    assert set(result.verdicts.values()) <= {"ok", "look"}
    assert set(result.moment_arms()["iliacus_right"]) >= {"hip_flexion_r"}


def test_each_guess_says_how_sure_it_is(files, tmp_path):
    init(*files, "--out", tmp_path)
    with (tmp_path / "guesses.csv").open() as lines:
        rows = list(csv.DictReader(lines))
    sure = {(row["what"], row["guess"]): float(row["confidence"]) for row in rows}
    assert list(sure.values()) == sorted(sure.values())
    assert sure["units", "m"] == 0.9
    areas = "muscles.iliacus_right.attachments"
    assert sure[areas, "insertion: femur_right"] == 0.64
    text = (tmp_path / "scene.toml").read_text()
    assert "# confidence 0.90: the longest side of all surfaces is" in text.split('units = "m"')[0]
    assert text.count("# confidence") == len(rows)
    scene = vtkmuscle.Scene.load(tmp_path / "scene.toml")
    origin, insertion = scene.muscles["iliacus_right"].attachments
    assert origin.confidence == pytest.approx(sure[areas, "origin: pelvis"], abs=0.01)
    assert insertion.confidence == 0.64
    assert scene.guessed["units"] == 0.9
    meshes = [file for file in files if file.suffix == ".vtp"]
    for file in meshes:  # in cm, or a small animal in mm
        write_polydata(file, arrays.with_points(part := read_surface(file), 100.0 * arrays.points_of(part)))
    done = init(*meshes, "--out", tmp_path / "cm")
    assert "0.40  units: mm; the longest side of all surfaces is" in done.output
    write_polydata(file, arrays.with_points(part, 1e-3 * arrays.points_of(part)))
    said = refused("init", *meshes, "--out", tmp_path / "two_units")
    assert re.search(r"iliacus_r\.vtp: its longest side is .*; scale all files to one unit", said)
    assert {key.split(".")[-1] for key in scene.guessed} == {"units", "centre", "axes"}


#: A hip that turns about z; the surfaces are in the frame of the pelvis.
MODEL = """<OpenSimDocument Version="40000"><Model name="hip"><Ground name="ground"/>
<BodySet><objects><Body name="pelvis"/><Body name="femur_r"/></objects></BodySet><JointSet><objects>
<WeldJoint name="ground_pelvis"><socket_parent_frame>raised</socket_parent_frame>
<socket_child_frame>/bodyset/pelvis</socket_child_frame><frames><PhysicalOffsetFrame name="raised">
<socket_parent>/ground</socket_parent><translation>0.1 0.9 0</translation></PhysicalOffsetFrame></frames>
</WeldJoint>
<PinJoint name="hip_r"><socket_parent_frame>/bodyset/pelvis</socket_parent_frame>
<socket_child_frame>/bodyset/femur_r</socket_child_frame><coordinates>
<Coordinate name="hip.flexion_r"><range>-0.5 1.5</range></Coordinate></coordinates></PinJoint>
</objects></JointSet></Model></OpenSimDocument>"""


def test_a_model_gives_the_joints(files, tmp_path):
    model = tmp_path / "model.osim"
    model.write_text(MODEL)
    init(*files, model, "--out", tmp_path / "scene")
    scene = vtkmuscle.Scene.load(tmp_path / "scene/scene.toml")
    assert scene.guessed["opensim.frame"] > 0.5
    assert scene.motion.centre_of("femur_right") == pytest.approx([0, 0, 0], abs=1e-9)
    assert scene.motion.at(60.0)["femur_right"][:3, 0] == pytest.approx([0.5, np.sin(np.radians(60)), 0])
    model.write_text(MODEL.replace("-0.5 1.5", "0 0"))
    assert "the scene cannot run yet" in init(*files, model, "--out", tmp_path / "still").output
    model.write_text(MODEL.replace("femur_r", "talus_r"))
    said = refused("init", *files, model, "--out", tmp_path / "other")
    assert "no body may be the bone 'femur_right'; name the mesh as one of the bodies: " in said
    fibula = files[1].with_name("fibula_r.vtp")
    fibula.write_bytes(files[1].read_bytes())
    model.write_text(MODEL.replace("femur_r", "tibia_r"))
    shank = files[1].rename(tmp_path / "shank_r.vtp")
    init(files[0], shank, fibula, *files[2:4], model, "--out", tmp_path / "shank")
    scene = vtkmuscle.Scene.load(tmp_path / "shank/scene.toml")
    assert (scene.motion.transforms["fibula_right"] == scene.motion.transforms["shank_right"]).all()


def test_each_muscle_has_its_architecture(files, tmp_path):
    init(*files, "--out", tmp_path)
    with (tmp_path / "volumes.csv").open() as lines:
        rows = {row["structure"]: row for row in csv.DictReader(lines)}
    assert {row["areas"] for row in rows.values()} == {"", "estimated"}
    own = {key: float(value) for key, value in rows["iliacus_right"].items() if re.match(r"[\d.]+$", value)}
    ratio = published("iliacus", "fibre_to_path")
    fascicle = np.sqrt(ratio.low * ratio.high) * own["fibre_length_mm"]
    assert own["fascicle_length_mm"] == pytest.approx(fascicle)
    assert own["pcsa_low_mm2"] < own["pcsa_mm2"] < own["pcsa_high_mm2"]
    # An ellipsoid alone is attached at its tips.
    upper, lower = areas_at_tips(pv.ParametricEllipsoid(10.0, 10.0, 100.0).clean().rotate_x(180.0))
    assert (upper.role, lower.role) == ("origin", "insertion")
    for area, height in ((upper, 80.0), (lower, -80.0)):
        assert area.landmarks[:, 2] == pytest.approx(height, abs=0.01)
        assert np.hypot(*area.landmarks[:, :2].T) == pytest.approx(6.0, rel=0.02)


@needs_chromium
@pytest.mark.slow
def test_guesses_accepted_on_the_page_count_as_given(files, tmp_path):
    init(*files, "--out", tmp_path)
    with Page() as page:
        page.open((tmp_path / "guesses.html").as_uri())
        assert page.value("new Set(draft.viewer.pixels()).size") > 50
        page.value("document.querySelectorAll('[data-guess]').forEach((box) => box.click())")
        text, errors = page.value("draft.text()"), page.errors
    assert errors == []
    (tmp_path / "scene.toml").write_text(text)
    scene = vtkmuscle.Scene.load(tmp_path / "scene.toml")
    assert scene.guessed == {}
    assert not any(area.confidence for muscle in scene.muscles.values() for area in muscle.attachments)


@pytest.mark.filterwarnings("ignore:.*of the bone lies in the bone")  # one surface, twice
def test_a_guess_that_is_not_sure_is_looked_at_until_it_is_confirmed(files, tmp_path):
    path = tmp_path / "scene.toml"
    init(*files, "--out", tmp_path)
    drawn = path.read_text().replace('"units" = 0.9', '"units" = 0.9\n"joints.knee.axis" = 0.1') + KNEE
    for old, new, key in (
        ("confidence = 0.64", "confidence = 0.11", r"muscles.iliacus_right.attachments\[1\]"),
        ('"units" = 0.9', '"units" = 0.3', "units"),
    ):
        path.write_text(drawn.replace(old, new))
        scene = vtkmuscle.Scene.load(path).with_muscles("iliacus_right")
        with pytest.warns(UserWarning, match="joints.knee"), pytest.warns(UserWarning, match=key):
            result = replace(scene, deformer="none").run(frames="0:1", figures=False)
        says = " ".join(result["iliacus_right"].reasons)
        assert result.verdicts == {"iliacus_right": "look"}
        assert ("low confidence" in says, "joints.knee" in says) == (True, False)  # the knee is not crossed


@pytest.mark.parametrize(
    ("keep", "words", "status"),
    [
        (("Femur R.vtp", "iliacus_r.vtp"), "angles in [motion.hinge]", 0),
        (("Pelvis.vtp", "iliacus_r_origin.csv"), "no known muscle and role", 2),
        (("iliacus_r.vtp", "iliacus_r_origin.csv"), "no bone can have the origin of 'iliacus_right'", 2),
    ],
)
def test_what_is_missing_is_named(files, tmp_path, keep, words, status):
    kept = [file for file in files if file.name in keep]
    done = init(*kept, "--out", tmp_path / "scene", status=status)
    assert words in " ".join(done.output.split())
    assert (tmp_path / "scene/volumes.csv").exists() == (status == 0)


@pytest.mark.parametrize("option", ["--bone", "--muscle"])
def test_a_stated_name_without_a_mesh_and_a_folder_are_errors(files, tmp_path, option):
    """A misspelt name was ignored; a folder was a file with an unknown name."""
    out = "--out", tmp_path / "scene"
    said = refused("init", *files, option, "pelvs", *out)
    assert f"{option}: no mesh has the name 'pelvs'; did you mean 'pelvis'?" in said
    assert f"{tmp_path}: this is a folder, not" in refused("init", tmp_path, *out)
    with pytest.raises(OSError, match=f"{tmp_path}: this is a folder"):  # a text, not its letters
        vtkmuscle.init(str(tmp_path), tmp_path / "scene")
    model = files[0].rename(tmp_path / "model.xml")
    assert "model.xml: this is no surface (.vtp, " in refused("init", model, *out)


def test_a_name_that_says_nothing_needs_a_word(files, tmp_path):
    given = [files[0], files[1], files[2].rename(tmp_path / "part.7.vtp")]
    assert "--muscle" in refused("init", *given, "--out", tmp_path / "scene")
    init(*given, "--muscle", "part.7", "--out", tmp_path / "scene")


def test_a_muscle_that_cannot_be_made_is_named_and_the_others_are_there(files, tmp_path):
    far = tmp_path / "sartorius.vtp"
    muscle = HIP.muscles["iliacus"]
    write_polydata(far, arrays.with_points(muscle, METRES * (arrays.points_of(muscle) + 400.0)))
    done = init(*files, far, "--out", tmp_path)
    assert "left out: sartorius: the muscle is near fewer than two bones" in " ".join(done.output.split())
    assert "sartorius" not in vtkmuscle.Scene.load(tmp_path / "scene.toml").muscles
    bones = dict(arrays.blocks_of(HIP.bones))  # of either side, by their names
    (axes,) = (guess for guess in guessed_joints(bones)[2] if guess.what == "joints.hip.axes")
    assert "of a right limb" in axes.why
    draft = Draft("hip", bones, {"iliacus": muscle})
    draft.guess("joints.hip", "", 0.0, "the head is not round")
    with pytest.raises(ValueError, match=r"both ends are on .* femur and pelvis; the head is not round"):
        draft._attach("iliacus")


def test_surfaces_are_looked_at_before_a_guess_is_made(files, tmp_path):
    """An open muscle is left out with the remedy; landmarks out of order are named; frames must agree."""
    ring = np.loadtxt(files[-1], delimiter=",")
    np.savetxt(files[-1], np.random.default_rng(0).permutation(ring), delimiter=",")
    torn = HIP.muscles["gluteus_medius"]
    torn = arrays.surface_from(METRES * arrays.points_of(torn), arrays.triangles_of(torn, "medius")[1:])
    write_polydata(files[2], torn)
    done = init(*files, "--out", tmp_path / "scene")
    words = " ".join(done.output.split())
    assert (
        "gluteus_medius_right: the surface is open: 3 edges belong to one triangle only; use vtkmuscle init"
        in words
    )
    assert re.search(r"0\.00 .*: landmarks of iliacus_r_origin\.csv; .*; order the landmarks along", words)
    scene = vtkmuscle.Scene.load(tmp_path / "scene/scene.toml")
    assert list(scene.muscles) == ["iliacus_right"]
    with pytest.warns(UserWarning, match=r"origin is estimated on 'pelvis' with low confidence \(0\.00\)"):
        check_sense(scene)
    writer = vtkSTLWriter(file_name=str(tmp_path / "femur_l.stl"), header="3D Slicer output. SPACE=RAS")
    writer.SetInputData(torn)
    writer.Write()
    said = refused("init", *files, tmp_path / "femur_l.stl", "--out", tmp_path / "other")
    assert "the header says RAS, but the frame is LPS; use --frame RAS" in said


def test_a_torn_muscle_is_repaired_on_request(files, tmp_path):
    """Holes, sides and crumbs of a muscle are repaired, up to a hundredth, and the given file stays."""
    whole = HIP.muscles["gluteus_medius"]
    points, triangles = METRES * arrays.points_of(whole), arrays.triangles_of(whole, "medius")
    crumb = points[triangles[0]].mean(axis=0) + 1e-4 * np.vstack([np.zeros(3), np.eye(3)])
    corners = len(points) + np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])
    touching = 50 + int(np.argmax(np.isin(triangles[50:], triangles[0]).sum(axis=1) == 1))
    rest = np.delete(triangles[50:], touching - 50, axis=0)
    torn = np.vstack([triangles[1:50, ::-1], rest, corners, rest[80:90]])  # these ten are double
    write_polydata(files[2], arrays.surface_from(np.vstack([points, crumb]), torn))
    before = files[2].read_bytes()
    init(*files, "--repair", "--out", tmp_path / "scene")
    guesses = (tmp_path / "scene/guesses.csv").read_text()
    for words in ("10 triangles were double", "2 hole(s), 6 edges", "49 of ", "1 small part(s) were left"):
        assert words in guesses
    surface = vtkmuscle.Scene.load(tmp_path / "scene/scene.toml").muscles["gluteus_medius_right"].surface
    assert survey(*arrays.checked_surface(surface, "")).volume == pytest.approx(
        METRES**3 * survey(arrays.points_of(whole), triangles).volume, rel=1e-3
    )
    assert files[2].read_bytes() == before


@pytest.mark.parametrize(
    ("kept", "words"), [(slice(300, None), "closed holes would be"), ("both", "all parts but")]
)
def test_large_faults_of_a_muscle_are_not_repaired(files, tmp_path, kept, words):
    muscle = HIP.muscles["gluteus_medius"]
    points, triangles = METRES * arrays.points_of(muscle), arrays.triangles_of(muscle, "medius")
    if kept == "both":
        points, triangles = np.vstack([points, points + 0.5]), np.vstack([triangles, triangles + len(points)])
    else:
        triangles = triangles[kept]
    write_polydata(files[2], arrays.surface_from(points, triangles))
    done = init(*files, "--repair", "--out", tmp_path / "scene")
    assert f"left out: gluteus_medius_right: {words}" in " ".join(done.output.split())
