"""Moment arms of a run: in the result, in tables, in the report and as a figure; from a scene's own words."""

import csv
import importlib.util
import json
from dataclasses import replace

import numpy as np
import pytest
from phantoms import tendon_through_ring
from tiny_scene import HINGE, MOTION, write_tiny_scene

from vtkmuscle import Result, Scene, SceneError, hinge, phantoms
from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.data.anatomy import published
from vtkmuscle.io.literature import drawn_curves
from vtkmuscle.plotting import can_render, plot_moment_arms

PUBLISHED = """source,muscle,part,dof,angle_deg,moment_arm_mm
A1985,spindle,,knee,0,-10
A1985,spindle,,knee,20,-14
B2005,spindle,fibres_lower_bound,knee,0,-20
B2005,spindle,fibres_lower_bound,knee,15,-18
B2005,spindle,fibres_upper_bound,knee,5,-5
B2005,spindle,fibres_upper_bound,knee,20,-4
C1999,spindle,whole,knee,10,-12
D,other,,knee,10,-12
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = write_tiny_scene(tmp_path_factory.mktemp("scene"))
    (path.parent / "published.csv").write_text(PUBLISHED)
    text = path.read_text().replace(MOTION, HINGE.replace("[0, 20, 5]", '[0, 20, 2.5]\ncoordinate = "knee"'))
    surface = 'surface = "muscles/spindle.vtp"'
    text = text.replace(surface, f'{surface}\nliterature = "published.csv"')
    path.write_text(text)
    return path.parent


@pytest.fixture(scope="module")
def scene(folder):
    return Scene.load(folder / "scene.toml")


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return tmp_path_factory.mktemp("out")


@pytest.fixture(scope="module")
def result(scene, out):
    return scene.run(out, figures=can_render() is None)


def table(path):
    with path.open(newline="") as lines:
        return list(csv.DictReader(lines))


def test_moment_arms_are_levers_and_the_slopes_of_the_lengths(result):
    found = result.moment_arms()["spindle"]["knee"]
    lengths, angles = result.lengths["spindle"], np.radians(result.times)
    np.testing.assert_allclose(found.slopes, -np.gradient(lengths, angles, axis=0, edge_order=2), atol=1e-9)
    paths = result.paths("spindle", frame=3)
    np.testing.assert_array_equal(found.arms[3], paths.levers["knee"])
    np.testing.assert_allclose(np.linalg.norm(np.diff(paths.points, axis=1), axis=2).sum(axis=1), lengths[3])
    # It goes round the joint at a distance of some 15 mm; by the whole change of length as well.
    whole = -(lengths[-1] - lengths[0]).mean() / angles[-1]
    assert found.mean.mean() == pytest.approx(whole, rel=0.1)
    assert 5.0 < abs(found.mean.mean()) < 30.0
    assert (found.unit, found.positive) == ("deg", "right-handed about (1, 0, 0)")
    np.testing.assert_array_equal(found.values, result.times)


def test_the_table_is_short_to_look_at_and_complete_as_columns(result):
    found = result.moment_arms("knee")
    assert len(repr(found)) < 300
    assert "spindle by knee, 0 to 20 deg: " in repr(found)
    columns = dict(found.table())
    assert {len(column) for column in columns.values()} == {6 * 9}
    assert columns["moment_arm_mm"][9] == found["spindle"]["knee"].arms[0, 1]
    with pytest.raises(KeyError, match="no moment arms of 'psoas'; available: spindle"):
        found["psoas"]
    with pytest.raises(ValueError, match="the motion has no coordinate 'hip'; it has: 'knee'"):
        result.moment_arms("hip")
    if importlib.util.find_spec("pandas") is None:
        with pytest.raises(ImportError, match=r"dict\(table\) gives arrays"):
            found.table().to_frame()
    else:
        assert list(found.table().to_frame().columns) == list(columns)


def test_tables_and_report_hold_them(result, out):
    found = result.moment_arms()["spindle"]["knee"]
    rows = table(out / "moment_arms.csv")
    assert len(rows) == 6 * 9
    for row in rows:
        frame, fibre = result.times.index(float(row["value"])), int(row["fibre"])
        assert (row["muscle"], row["coordinate"], row["unit"]) == ("spindle", "knee", "deg")
        assert int(row["frame"]) == result.frames[frame]
        assert float(row["moment_arm_mm"]) == pytest.approx(found.arms[frame, fibre], rel=1e-9)
        assert float(row["slope_mm"]) == pytest.approx(found.slopes[frame, fibre], rel=1e-9, abs=1e-12)
        assert float(row["quartic_mm"]) == pytest.approx(found.quartic[frame, fibre], rel=1e-9)
    summary = table(out / "moment_arms_summary.csv")
    assert [float(row["value"]) for row in summary] == result.times
    for frame, row in enumerate(summary):
        assert float(row["mean_mm"]) == pytest.approx(found.mean[frame])
        assert float(row["error_mm"]) == pytest.approx(found.errors["total"][frame])
        assert found.errors["model"][frame] >= 0.7 * found.arms[frame].std(ddof=1) > 0.0
        assert float(row["min_mm"]) == pytest.approx(found.arms[frame].min())
        assert float(row["max_mm"]) == pytest.approx(found.arms[frame].max())
    report = json.loads((out / "report.json").read_text())
    mine = report["muscles"]["spindle"]["moment_arms"]["knee"]
    assert mine["mean_mm"] == pytest.approx(found.arms.mean())
    assert mine["errors"]["model_mm"] == pytest.approx(np.sqrt(np.mean(found.errors["model"] ** 2)))
    assert mine["positive"] == "right-handed about (1, 0, 0)"
    assert "moment_arms" in report["definitions"]


def test_means_through_via_rings_have_no_error(tmp_path):
    scene = replace(Scene.from_phantom(tendon_through_ring(), n_fibres=8), deformer="none")
    result = scene.run(tmp_path / "out", frames="0:3", figures=False)
    assert {row["error_mm"] for row in table(tmp_path / "out/moment_arms_summary.csv")} == {""}
    assert {row["mean_error_mm"] for row in table(tmp_path / "out/lengths.csv")} == {""}
    assert result.report["muscles"]["muscle"]["errors"]["total_mm"] is None
    assert ", error \u2013 mm" in (tmp_path / "out/report.html").read_text(encoding="utf-8")


def test_published_ranges_are_drawn_without_being_asked_for():
    plain = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=6)
    motion = hinge("distal", (0, 0, 0), (-1, 0, 0), [-20.0, -10.0, 0.0], coordinate="knee_extension")
    muscles = {"spindle": replace(plain.muscles["spindle"], muscle="semimembranosus")}
    scene = replace(plain, motion=motion, muscles=muscles, deformer="none", paths={"bows": False})
    result = scene.run(figures=False)
    assert result.report["muscles"]["spindle"]["errors"]["bow_mm"] == 0.0
    (band,) = drawn_curves(result.published_arms("spindle"))
    flexion = published("semimembranosus", "moment_arm", "knee_flexion")
    assert (band.arms[0], band.upper[0]) == (-flexion.high, -flexion.low)
    assert (band.label, *band.angles) == (f"{flexion.source}, range", -20.0, 0.0)
    assert result.literature == {"spindle": ()}
    other = replace(scene, motion=plain.motion).run(figures=False)
    left = [one.report["muscles"]["spindle"]["verdict"]["not_checked"] for one in (result, other)]
    assert "published arms" not in left[0]
    assert "by distal_angle" in left[1]["published arms"]


def test_the_literature_is_drawn_where_its_coordinate_is_that_of_the_motion(result):
    arms, curves = result.moment_arms()["spindle"], result.literature["spindle"]

    def drawn(literature):
        axes = plot_moment_arms(arms, literature=literature).axes[0]
        return len(axes.lines) + len(axes.collections)

    assert drawn([replace(curve, dof="hip") for curve in curves]) == drawn(()) < drawn(curves)


def test_without_a_coordinate_nothing_is_written_and_what_was_there_goes(scene, result, out, tmp_path):
    still = replace(scene, motion=replace(scene.motion, coordinates={}))
    scene.run(tmp_path, frames="0:4", figures=False)
    assert (tmp_path / "moment_arms.csv").exists()
    plain = still.run(tmp_path, frames="0:2", figures=False)
    assert not (tmp_path / "moment_arms.csv").exists()
    assert "moment_arms" not in plain.report
    with pytest.raises(ValueError, match="no coordinate of the motion changes"):
        plain.moment_arms()


def test_a_single_frame_has_moment_arms_where_the_joint_is_known(scene, result, tmp_path):
    found = scene.run(tmp_path, frames="3:4", figures=False).moment_arms()["spindle"]["knee"]
    np.testing.assert_allclose(found.arms, result.moment_arms()["spindle"]["knee"].arms[3:4], atol=0.05)
    (row,) = table(tmp_path / "moment_arms_summary.csv")
    assert row["slope_mean_mm"] == row["quartic_mean_mm"] == ""
    again = Result.load(tmp_path).moment_arms()["spindle"]["knee"]
    np.testing.assert_array_equal(again.arms, found.arms)


# ------------------------------------------------------------------------------- scenes


def edited(folder, tmp_path, old, new):
    text = (folder / "scene.toml").read_text()
    assert old in text
    path = folder / f"{tmp_path.name}.toml"
    path.write_text(text.replace(old, new))
    return path


TABLE = """
[motion]
bone = "lower"
transforms = "swing.csv"
COORDINATES
"""


def table_scene(folder, tmp_path, coordinates):
    swing = hinge("lower", (0, -15, 0), (1, 0, 0), [0, 5, 10])
    swing = replace(swing, coordinates={"knee": Coordinate([0.0, 5, 10]), "slide": Coordinate([0.0, 1, 3])})
    from vtkmuscle.io import write_motion_table

    write_motion_table(folder / "swing.csv", swing, "lower")
    text = (folder / "scene.toml").read_text()
    old = text[text.index("[motion.hinge]") : text.index("[muscles")]
    return edited(folder, tmp_path, old, TABLE.replace("COORDINATES", coordinates))


@pytest.mark.parametrize(
    ("coordinates", "found"),
    [
        ("", {}),
        ('time = "time"', {}),
        ('time = "knee"', {"knee": ("deg", "")}),
        ('coordinates = ["knee"]', {"knee": ("deg", "")}),
        (
            'coordinates = { knee = { positive = "flexion" }, slide = { unit = "mm" } }',
            {"knee": ("deg", "flexion"), "slide": ("mm", "")},
        ),
    ],
)
def test_a_table_says_what_its_coordinates_are(coordinates, found, folder, tmp_path):
    motion = Scene.load(table_scene(folder, tmp_path, coordinates)).motion
    assert {name: (one.unit, one.positive) for name, one in motion.coordinates.items()} == found


@pytest.mark.parametrize(
    ("coordinates", "message"),
    [
        (
            'coordinates = ["hip"]',
            "no column 'hip' for a coordinate; the other columns are: time, knee, slide",
        ),
        ('coordinates = "knee"', "motion.coordinates: must be a list of names, not 'knee'"),
        (
            'coordinates = { knee = { unit = "degrees" } }',
            "motion.coordinates.knee.unit: must be .*, not 'degrees'",
        ),
        ("coordinates = { knee = { up = true } }", "motion.coordinates.knee.up: there is no such key"),
    ],
)
def test_a_fault_of_its_coordinates_is_named(coordinates, message, folder, tmp_path):
    with pytest.raises(SceneError, match=message):
        Scene.load(table_scene(folder, tmp_path, coordinates))
