"""Every fault in a scene gives one error that names the file, the key and the mend."""

import json
import pickle
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from tiny_scene import HINGE, MOTION, TOML, edit, ellipsoid, ring
from vtkmodules.vtkFiltersCore import vtkAppendPolyData

from vtkmuscle import Scene, SceneError
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.data.arrays import (
    Polylines,
    points_of,
    polylines_from,
    polylines_of,
    surface_from,
    triangles_of,
    with_points,
)
from vtkmuscle.filters import PathDeformer, PBDDeformer, TautPaths
from vtkmuscle.filters.fibre_template_source import FibreTemplateSource
from vtkmuscle.io import read_surface, write_polydata
from vtkmuscle.scene import schema
from vtkmuscle.scene.writing import tables_of


def failure(path):
    with pytest.raises(SceneError) as caught:
        Scene.load(path)
    return caught.value


def surface_parts(path):
    surface = read_surface(path)
    return points_of(surface), triangles_of(surface, "surface")


# ------------------------------------------------------------------------------- what is read


def test_a_good_scene_is_read_as_it_stands(scene_file):
    scene = Scene.load(scene_file)
    assert (scene.name, scene.units, scene.millimetres) == ("tiny", "mm", 1.0)
    assert list(scene.bones) == ["upper", "lower"]
    muscle = scene.muscles["spindle"]
    assert muscle.fibres == {"template": "parallel", "n_fibres": 6, "resolution": 5}
    assert [(a.role, a.bone, len(a.landmarks), a.closed) for a in muscle.attachments] == [
        ("origin", "upper", 8, True),
        ("insertion", "lower", 8, True),
    ]
    assert scene.solver_of("spindle") == {"iterations": 3}
    assert scene.motion.times.tolist() == [0, 5, 10, 15, 20]
    assert scene.motion.centre.tolist() == [0, -15, 0]


@pytest.mark.parametrize(
    ("angles", "times"),
    [
        ("[0, 90, 30]", [0, 30, 60, 90]),
        ("[0, 0.3, 0.1]", [0, 0.1, 0.2, 0.3]),
        ("[-10, 15, 10]", [-10, 0, 10, 15]),
        ("[5, 5, 1]", [5]),
    ],
)
def test_a_hinge_takes_both_ends_in(angles, times, scene_file):
    edit(scene_file, MOTION, HINGE.replace("[0, 20, 5]", angles))
    found = Scene.load(scene_file).motion.times
    np.testing.assert_allclose(found, times, atol=1e-12)
    assert found[-1] == times[-1]


def test_settings_of_a_muscle_go_before_those_of_the_scene(scene_file):
    edit(
        scene_file,
        "[solver]",
        "solver = { iterations = 7, bone_clearance = 1 }\nfixing = { distance = 2.5 }\n"
        "[solver]\nmeasure_penetration = true",
    )
    scene = Scene.load(scene_file)
    assert scene.solver_of("spindle") == {"iterations": 7, "bone_clearance": 1, "measure_penetration": True}
    assert scene.fixing_of("spindle") == {"distance": 2.5}


def test_an_inside_out_muscle_is_turned_with_a_warning(scene_file):
    path = scene_file.parent / "muscles/spindle.vtp"
    points, triangles = surface_parts(path)
    write_polydata(path, surface_from(points, triangles[:, ::-1]))
    with pytest.warns(UserWarning, match=r"spindle\.vtp: muscles\.spindle\.surface: the surface is inside"):
        surface = Scene.load(scene_file).muscles["spindle"].surface
    assert signed_volume(points_of(surface), triangles_of(surface, "x")) > 0
    np.testing.assert_array_equal(points_of(surface), points)


def test_an_open_bone_will_do_and_the_run_says_what_was_made_of_it(scene_file):
    path = scene_file.parent / "bones/upper.vtp"
    points, triangles = surface_parts(path)
    write_polydata(path, surface_from(points, triangles[1:]))
    edit(scene_file, "iterations = 3", "iterations = 3\nbone_clearance = 6.0")  # else no point comes near it
    scene = Scene.load(scene_file)
    assert scene.bones["upper"].GetNumberOfCells() == len(triangles) - 1
    with pytest.warns(UserWarning, match=r"block 'upper': the surface is open: 1 hole\(s\), 3 edges"):
        result = scene.run(frames="0:2", figures=False)
    assert all(np.isfinite(row["volume_ratio"]) for row in result.report["muscles"]["spindle"]["frames"])


@pytest.mark.parametrize("moving", ["lower", "upper"])
def test_attachments_may_be_estimated(scene_file, moving, tmp_path):
    """From where the muscle touches the bones; the one that moves has the insertion. They stay marked."""
    edit(scene_file, LIST, 'attachments = "estimate"')
    edit(scene_file, 'bone = "lower"', f'bone = "{moving}"')
    for bone in ("lower", "upper"):  # nearer, so that they touch the muscle
        path = scene_file.parent / f"bones/{bone}.vtp"
        surface = read_surface(path)
        write_polydata(path, with_points(surface, points_of(surface) + np.array([0.0, 5.0, 0.0])))
    scene = Scene.load(scene_file)
    areas = scene.muscles["spindle"].attachments
    assert {(area.role, area.bone == moving) for area in areas} == {("origin", False), ("insertion", True)}
    with pytest.raises(SceneError, match="give the folder"):
        scene.save(tmp_path / "saved.toml")
    again = Scene.load(scene.save(tmp_path / "saved")).muscles["spindle"].attachments
    assert all(area.estimated for area in (*areas, *again))
    for mine, yours in zip(areas, again, strict=True):
        np.testing.assert_allclose(mine.landmarks, yours.landmarks, atol=1e-9)
    report = scene.run(frames="0:1", figures=False, sense=False).report["muscles"]["spindle"]
    assert report["estimated_attachments"] == 2
    assert 0.0 < report["attachment_confidence"] == min(area.confidence for area in areas) <= 0.64
    # Two bones may be named, the bone of the origin first.
    (still,) = {"lower", "upper"} - {moving}
    edit(scene_file, '"estimate"', f'{{ estimate = ["{moving}", "{still}"] }}')
    named = Scene.load(scene_file).muscles["spindle"].attachments
    assert [(area.role, area.bone == moving) for area in named] == [("origin", True), ("insertion", False)]


SHEETS = [[[0, 0, z], [1, 0, z], [1, 1, z], [0, 1, z]] for z in (0, 0.5, 1)]


def test_a_template_of_ones_own_is_beside_the_scene(scene_file, tmp_path, monkeypatch):
    (scene_file.parent / "own.json").write_text(json.dumps({"sheets": SHEETS}))
    with_template(scene_file, '"own.json"')
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    scene = Scene.load(scene_file)
    named = scene.muscles["spindle"].fibres["template_file"]
    assert Path(named) == (scene_file.parent / "own.json").resolve()
    again = Scene.load(scene.save(elsewhere / "saved"))
    assert again.muscles["spindle"].fibres["template_file"] == named
    assert FibreTemplateSource(template_file=named, n_fibres=3).update().output.GetNumberOfCells() == 3


def with_template(scene_file, name):
    """Let a scene's fibres have a template from a file."""
    text = scene_file.read_text()
    changed = re.sub(r"fibres = \{\s*", f"fibres = {{ template_file = {name}, ", text)
    assert changed != text
    scene_file.write_text(changed)


# ------------------------------------------------------------------------------- superficial fibres


def test_superficial_fibres_are_read_used_and_saved(scene_file, tmp_path):
    plain = Scene.load(scene_file).run(frames="0:2", figures=False)
    seen = Polylines(
        np.array([(10.0, 0, -5), (9.0, 4, 5), (-10.0, 0, -5), (-9.0, -4, 5)]), np.array([0, 2, 4])
    )
    write_polydata(scene_file.parent / "seen.vtp", polylines_from(seen))
    edit(scene_file, "[solver]", 'superficial_fibres = "seen.vtp"\n[solver]')
    scene = Scene.load(scene_file)
    lines = polylines_of(scene.muscles["spindle"].superficial_fibres, "seen")
    np.testing.assert_array_equal(lines.points, seen.points)
    again = Scene.load(scene.save(tmp_path / "again"))
    assert tables_of(again) == tables_of(scene)
    same = polylines_of(again.muscles["spindle"].superficial_fibres, "seen")
    np.testing.assert_array_equal(same.points, lines.points)
    with pytest.warns(UserWarning, match="superficial fibres deviate"):
        result = scene.run(frames="0:2", figures=False)
    report, before = (r.report["muscles"]["spindle"]["fibres"] for r in (result, plain))
    assert "superficial_angle_degrees" not in before
    assert 0.0 < report["superficial_angle_degrees"] < 45.0


def via(scene_file, landmarks):
    """Add a via ring to the scene, from a file of landmarks; it is on the second line of attachments."""
    text = "\n".join(",".join(map(str, row)) for row in landmarks)
    (scene_file.parent / "ring.csv").write_text(text)
    entry = '{ role = "via", bone = "lower", landmarks = "ring.csv" }'
    edit(scene_file, f"  {ORIGIN},\n", f"  {ORIGIN},\n  {entry},\n")


@pytest.mark.parametrize("repeated", [False, True])
def test_a_via_ring_is_read_as_a_ring_and_saved(scene_file, tmp_path, repeated):
    landmarks = ring(5.0) * [1.2, 1.2, 1.0]
    via(scene_file, np.vstack([landmarks, landmarks[:1]]) if repeated else landmarks)
    scene = Scene.load(scene_file)
    for loaded in (scene, Scene.load(scene.save(tmp_path / "again"))):
        areas = loaded.muscles["spindle"].attachments
        assert [(a.role, a.bone, len(a.landmarks), a.closed) for a in areas] == [
            ("origin", "upper", 8, True),
            ("via", "lower", 8, True),
            ("insertion", "lower", 8, True),
        ]
        np.testing.assert_allclose(areas[1].landmarks, landmarks, atol=1e-12)
    assert 'role = "via"' in (tmp_path / "again" / "scene.toml").read_text()


@pytest.mark.parametrize(
    ("landmarks", "problem", "mend"),
    [
        (ring(5.0)[:2], "needs 3", "add landmarks"),
        (ring(5.0) * [1.0, 0.0, 1.0], "on a line", "in order"),
        (ring(5.0)[[0, 1, 2, 4, 3, 5, 6, 7]], "turns back after landmark", "in order"),
        (np.add(ring(5.0), [20.0, 0.0, 0.0]), "does not pass through", "same unit"),
        (np.add(ring(5.0), [0.0, 0.0, 60.0]), "does not pass through", "same unit"),
    ],
)
def test_a_via_ring_that_does_not_hold_the_muscle_is_refused(scene_file, landmarks, problem, mend):
    via(scene_file, landmarks)
    error = failure(scene_file)
    assert error.key == "muscles.spindle.attachments[1].landmarks"
    assert problem in error.problem
    assert mend in error.remedy
    assert error.file == scene_file.parent / "ring.csv"


# ------------------------------------------------------------------------------- what is refused

LIST = TOML[TOML.index("attachments = [") : TOML.index("]\n\n[solver]") + 1]
INSERTION = '  { role = "insertion", bone = "lower", landmarks = "attachments/insertion.vtp" },\n'
ORIGIN = '{ role = "origin", bone = "upper", landmarks = "attachments/origin.vtp" }'
FIBRES = 'fibres = { template = "parallel", n_fibres = 6, resolution = 5 }'
MUSCLE, AREAS = "muscles.spindle", "muscles.spindle.attachments"
FAULTS = [
    # old text, new text, key, part of the problem, part of the mend
    ('name = "tiny"', 'nmae = "tiny"', "nmae", "no such key", "did you mean 'name'"),
    ('name = "tiny"', 'name = ""', "name", "the text is empty", "name = "),
    ('name = "tiny"', "name = 3", "name", "must be a valid string, not 3", "name = "),
    ('name = "tiny"', 'name = "a/b"', "name", "'a/b' cannot be part of a file name", "letters"),
    ('units = "mm"', 'units = "inch"', "units", "'m', not 'inch'", "mm, cm, m"),
    ('surface = "bones/upper.vtp"', "", "bones.upper.surface", "is missing", "add surface"),
    ("bones/upper.vtp", "bones/uper.vtp", "bones.upper.surface", "no such file", "upper.vtp"),
    (MOTION, "", "motion", "is missing", "motion = {"),
    ('transforms = "motion.csv"', 'transforms = "m.csv"', "motion.transforms", "no such file", "motion.csv"),
    ("[motion]", "motion = 3\n[xyz]", "xyz", "no such key", "allowed: name, units"),
    ('bone = "lower"\n', "", "motion.bone", "is missing", "add bone"),
    ('bone = "lower"\n', 'bone = "lwoer"\n', "motion.bone", "no bone 'lwoer'", "did you mean 'lower'"),
    ('time = "time"', 'time = "angle"', "motion.transforms", "no column 'angle'", "other columns are: time"),
    ("[0.0, -15.0, 0.0]", "[0.0, -15.0]", "motion.centre", "at least 3 items, not 2", "centre = "),
    ("[0.0, -15.0, 0.0]", "[0.0, nan, 0.0]", "motion.centre[1]", "must be a finite number", "centre = "),
    (MOTION, MOTION + HINGE, "motion.bone", "cannot be combined with motion.hinge", "remove either"),
    (MOTION, HINGE.replace('"lower"', '"x"'), "motion.hinge.bone", "no bone 'x'", "upper, lower"),
    (MOTION, HINGE.replace("[1.0, 0.0, 0.0]", "[0, 0, 0]"), "motion.hinge.axis", "no length", "write axis"),
    (MOTION, HINGE.replace("[0, 20, 5]", "[0, 20, 0]"), "motion.hinge.angles", "not ascend", "step > 0"),
    (MOTION, HINGE.replace("[0, 20, 5]", "[0, -20, -5]"), "motion.hinge.angles", "not ascend", "negate axis"),
    (MOTION, HINGE.replace("[0, 20, 5]", "[0, 20, 1e-9]"), "motion.hinge.angles", "frames", "larger step"),
    (MOTION, MOTION.replace('"motion.csv"', '{ lower = "motion.csv" }'), "motion.bone", "combined", "remove"),
    ("[muscles.spindle]", "[muscles.bones]", "muscles.bones", "overwrite other results", "another name"),
    (f"  {ORIGIN},\n", "", AREAS, "role 'origin'", "or leave out fibres"),
    (LIST, "", AREAS, "role 'origin'", '= "estimate"'),
    (LIST, 'attachments = "guess"', AREAS, "must be a list", '"estimate"'),
    (LIST, 'attachments = { estimate = ["upper"] }', AREAS, "must name two bones", ""),
    (LIST, 'attachments = { guess = ["upper", "lower"] }', AREAS, "must name two bones", ""),
    (LIST, 'attachments = { estimate = ["upper", "elbow"] }', AREAS, "no bone 'elbow'", ""),
    (LIST, 'attachments = { estimate = ["upper", "upper"] }', AREAS, "both 'upper'", ""),
    (ORIGIN, "3", AREAS + "[0]", "must be a table", "format"),
    ('role = "origin"', 'role = "orgin"', AREAS + "[0].role", "not 'orgin'", "did you mean 'origin'"),
    (ORIGIN, ORIGIN.replace("upper", "uper"), AREAS + "[0].bone", "no bone 'uper'", "'upper'"),
    (ORIGIN, ORIGIN.replace("origin.vtp", "o.vtp"), AREAS + "[0].landmarks", "no such file", "origin.vtp"),
    (FIBRES, FIBRES.replace("parallel", "paralel"), MUSCLE + ".fibres.template", "not allowed", "'parallel'"),
    ("iterations = 3", "iterations = 0", "solver.iterations", "0 is not allowed", "an integer >= 1"),
    ("iterations = 3", "bone_clearance = nan", "solver.bone_clearance", "nan is not", "a finite number"),
    ("[solver]", '[fixing]\nmethod = "glue"\n[solver]', "fixing.method", "not allowed", "proximity"),
    ("[solver]", "[paths]\norder = 5\n[solver]", "paths.order", "no such key", "in the table solver"),
    (FIBRES, FIBRES + "\nquality = 3", MUSCLE + ".quality", "no such key", "above the first [table]"),
    (MOTION, HINGE.replace("20, 5]", "20]"), "motion.hinge.angles", "must be start, stop and step", "[0, 90"),
    ("[solver]", "fixing = { dist = 1 }\n[solver]", MUSCLE + ".fixing.dist", "no such key", "'distance'"),
]


@pytest.mark.parametrize(
    ("old", "new", "key", "problem", "mend"), FAULTS, ids=[f"{f[2]}: {f[3]}" for f in FAULTS]
)
def test_a_fault_in_the_file_is_named_with_its_mend(old, new, key, problem, mend, scene_file):
    edit(scene_file, old, new)
    error = failure(scene_file)
    assert error.key == key
    assert problem in error.problem
    assert mend in error.remedy
    assert str(error).startswith(f"{error.file}: {key}: ")
    assert error.file.is_relative_to(scene_file.parent)


def test_all_faults_are_said_at_once(scene_file):
    edit(scene_file, 'units = "mm"', 'unit = "inch"')
    edit(scene_file, "[bones.upper]", "[bones.upper]\ncolour = 1")
    edit(scene_file, ORIGIN, ORIGIN.replace("origin", "orgin", 1))
    edit(scene_file, "iterations = 3", "iterations = 0\nstifness = 1")
    error = failure(scene_file)
    assert {fault.key for fault in error.faults} == {
        "unit",
        "bones.upper.colour",
        "muscles.spindle.attachments[0].role",
        "solver.iterations",
        "solver.stifness",
    }
    assert str(error).splitlines() == [str(fault).splitlines()[0] for fault in error.faults]
    assert all(fault.problem and fault.remedy and fault.file == scene_file for fault in error.faults)
    assert "did you mean 'units'" in next(fault.remedy for fault in error.faults if fault.key == "unit")
    again = pickle.loads(pickle.dumps(error))
    assert [fault.key for fault in again.faults] == [fault.key for fault in error.faults]


def test_all_files_that_cannot_be_read_are_said_at_once(scene_file):
    for name in ("bones/upper.vtp", "motion.csv", "attachments/origin.vtp", "muscles/spindle.vtp"):
        (scene_file.parent / name).unlink()
    assert {fault.key for fault in failure(scene_file).faults} == {
        "bones.upper.surface",
        "motion.transforms",
        "muscles.spindle.attachments[0].landmarks",
        "muscles.spindle.surface",
    }


def test_every_key_says_what_it_is():
    of_deformers = PathDeformer.parameter_declarations | PBDDeformer.parameter_declarations
    assert schema.Solver.model_fields.keys() == of_deformers.keys()
    assert schema.Paths.model_fields.keys() == TautPaths.parameter_declarations.keys()
    for table in schema.SchemaTable.__subclasses__():
        assert all(field.description for field in table.model_fields.values()), table


def test_faults_outside_the_keys_name_the_file(tmp_path, scene_file):
    edit(scene_file, "[bones.lower]", "[bones.lower")
    assert "not valid TOML" in str(failure(scene_file))
    assert "line 8" in str(failure(scene_file))
    assert "no such file" in str(failure(tmp_path / "no.toml"))
    assert f"give a scene file, e.g. {scene_file}" in str(failure(scene_file.parent))
    (tmp_path / "latin.toml").write_bytes('name = "hüfte"'.encode("latin-1"))
    assert "save it as UTF-8" in str(failure(tmp_path / "latin.toml"))


@pytest.mark.parametrize(("name", "key"), [("spindle_fibres", "spindle_fibres"), ("Spindle", "spindle")])
def test_a_muscle_that_would_overwrite_anothers_files_is_refused(scene_file, name, key):
    """Not every system tells capitals from small letters."""
    text = scene_file.read_text()
    block = text[text.index("[muscles.spindle]") : text.index("[solver]")]
    scene_file.write_text(text.replace(block, block + block.replace("spindle]", f"{name}]")))
    assert failure(scene_file).key == f"muscles.{key}"


def moved(points, triangles):
    points[3, 1] = np.nan
    return surface_from(points, triangles)


def two_pieces(points, triangles):
    both = vtkAppendPolyData()
    both.AddInputData(ellipsoid((1, 1, 1), (0, 0, 0)))
    both.AddInputData(ellipsoid((8, 8, 40), (90, 0, 0)))
    both.Update()
    return both.GetOutput()


def one_turned(points, triangles):
    triangles[5] = triangles[5, ::-1]
    return surface_from(points, triangles)


def a_fin(points, triangles):
    fin = np.array([[*triangles[0, :2], len(points)], [*triangles[0, 1::-1], len(points)]])
    return surface_from(np.vstack([points, [[20.0, 0, 0]]]), np.vstack([triangles, fin]))


def flat(points, triangles):
    return surface_from(points * [1.0, 1.0, 0.0], triangles)


SURFACE_FAULTS = [
    (moved, "1 point(s) are not finite, the first is point 3", "correct the points"),
    (lambda p, t: surface_from(p, t[1:]), "open: 3 edges", "fill the holes"),
    (a_fin, "not manifold: 1 edges", "delete the extra triangles"),
    (one_turned, "face opposite sides at 3 edges", "orient the triangles alike"),
    (flat, "no volume", "export the surface again"),
    (two_pieces, "2 separate pieces", "extract_largest"),
    (
        lambda p, t: surface_from(np.vstack([p, [[0.0, 0, 0]]]), t),
        "1 points belong to no triangle",
        "clean()",
    ),
]


@pytest.mark.parametrize(("spoil", "problem", "mend"), SURFACE_FAULTS, ids=[f[1] for f in SURFACE_FAULTS])
def test_a_fault_in_a_muscle_is_named_with_its_mend(spoil, problem, mend, scene_file):
    path = scene_file.parent / "muscles/spindle.vtp"
    write_polydata(path, spoil(*surface_parts(path)))
    error = failure(scene_file)
    assert (error.file, error.key) == (path, "muscles.spindle.surface")
    assert problem in error.problem
    assert mend in error.remedy


def test_tables_of_several_bones_must_agree_in_time(scene_file):
    edit(
        scene_file,
        'bone = "lower"\ntransforms = "motion.csv"',
        'transforms = { lower = "motion.csv", upper = "b.csv" }',
    )
    rows = (scene_file.parent / "motion.csv").read_text().splitlines()
    (scene_file.parent / "b.csv").write_text("\n".join(rows[:-1]))
    error = failure(scene_file)
    assert error.key == "motion.transforms.upper"
    assert "equal times" in error.remedy


# ------------------------------------------------------------------------------- writing


def test_a_saved_scene_is_the_same_scene(scene_file, tmp_path):
    edit(
        scene_file,
        "[solver]",
        "solver = { bone_clearance = 1e-9, measure_penetration = false }\nfixing = { distance = 0.1 }\n"
        '[fixing]\nmethod = "attachment"\n[solver]',
    )
    first = Scene.load(scene_file)
    second = Scene.load(first.save(tmp_path / "again"))
    assert tables_of(second) == tables_of(first)
    assert (second.name, second.units) == (first.name, first.units)
    assert second.solver_of("spindle") == first.solver_of("spindle")
    assert second.fixing_of("spindle") == first.fixing_of("spindle")
    np.testing.assert_array_equal(second.motion.transforms["lower"], first.motion.transforms["lower"])
    np.testing.assert_array_equal(second.motion.centre, first.motion.centre)
    for name in first.bones:
        np.testing.assert_array_equal(points_of(second.bones[name]), points_of(first.bones[name]))
    one, two = first.muscles["spindle"], second.muscles["spindle"]
    np.testing.assert_array_equal(points_of(two.surface), points_of(one.surface))
    assert two.fibres == one.fibres
    for mine, yours in zip(one.attachments, two.attachments, strict=True):
        assert (mine.role, mine.bone, mine.closed) == (yours.role, yours.bone, yours.closed)
        np.testing.assert_array_equal(mine.landmarks, yours.landmarks)


def test_a_scene_made_in_python_is_checked_too(scene_file):
    loaded = Scene.load(scene_file)
    with pytest.raises(SceneError, match=r"^scene: motion\.bone: there is no bone 'lower'"):
        Scene("x", {"upper": loaded.bones["upper"]}, loaded.muscles, loaded.motion)
    with pytest.raises(SceneError, match="no muscles"):
        Scene("x", loaded.bones, {}, loaded.motion)


@pytest.mark.realdata
@pytest.mark.parametrize("name", ["scene.toml", "scene_lite.toml"])
def test_the_real_hip_is_read(name, lhdl_hip):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        scene = Scene.load(lhdl_hip / name)
    assert [str(w.message) for w in caught] == []
    assert list(scene.muscles) == ["gluteus_maximus", "gluteus_medius", "iliacus", "adductor_brevis"]
    assert len(scene.motion.times) == 46
    assert [a.closed for a in scene.muscles["gluteus_maximus"].attachments] == [True, True, True, False]
