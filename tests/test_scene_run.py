"""A run computes what was asked for, writes all of it complete, and loses nothing that is finished."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
import pyvista
from phantoms import flexor_over_brim
from shapes import HalfSpace
from slow import slow
from test_metamorphic import mapped
from tiny_scene import write_tiny_scene

from vtkmuscle import Scene, SceneError
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.surface import edge_lengths, signed_volume, unique_edges
from vtkmuscle.core.motion.coordinates import MILLIMETRES
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.data.arrays import cell_array, point_array, points_of, polylines_of, triangles_of
from vtkmuscle.io import read_polydata
from vtkmuscle.run import frame_numbers
from vtkmuscle.run.measure import MuscleMeasure

#: How far a pose asked for alone may be from the same pose after others: where its paths start differs [mm].
SOLVED = 0.02

FRAMES = 5


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory):
    path = write_tiny_scene(tmp_path_factory.mktemp("scene"))
    # A second muscle, that only differs in its settings and has no fibres.
    text = path.read_text()
    start, end = text.index("[muscles.spindle]"), text.index("[solver]")
    plain = "".join(
        line for line in text[start:end].splitlines(keepends=True) if not line.startswith("fibres")
    )
    plain = plain.replace("spindle]", "plain]") + "solver = { iterations = 5 }\n\n"
    path.write_text(text[:end] + plain + text[end:])
    return path


@pytest.fixture(scope="module")
def scene(scene_file):
    return Scene.load(scene_file)


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return tmp_path_factory.mktemp("out")


@pytest.fixture(scope="module")
def result(scene, out):
    return scene.run(out, figures=False)


def files(folder):
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def all_numbers(value):
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        return [number for item in value for number in all_numbers(item)]
    return [value] if isinstance(value, int | float) else []


@pytest.mark.parametrize(
    ("name", "asked", "words"),
    [
        ("spindle", {"frame": 5}, "frame 5 was not kept; there are 0, 1, 2, 3, 4"),
        ("spindle", {"frame": -6}, "frame -6 was not kept"),
        ("spindle", {"time": 27.0}, "no frame of time 27 was kept; there are 0, 5, 10, 15, 20"),
        ("spindle", {}, "either the number of a frame"),
        ("spindle", {"frame": 0, "time": 0.0}, "either the number of a frame"),
        ("spindel", {"frame": 0}, "no muscle 'spindel' in the result; did you mean 'spindle'"),
    ],
)
def test_what_is_not_there_is_said(result, name, asked, words):
    for ask in (result.muscle, result.fibres):
        with pytest.raises(ValueError, match=words):
            ask(name, **asked)


# ------------------------------------------------------------------------------- what comes back


def test_the_result_has_every_frame_of_every_muscle(result):
    assert result.muscle_names == ["spindle", "plain"]
    assert result.times == [0, 5, 10, 15, 20]
    assert result.lengths.keys() == {"spindle"}
    assert result.lengths["spindle"].shape == (FRAMES, 6)
    assert result.fibres("plain", frame=0) is None
    for i in range(FRAMES):
        assert result.fibres("spindle", frame=i).GetNumberOfCells() == 6
        for name in result.muscle_names:
            muscle = result.muscle(name, frame=i)
            assert np.isfinite(points_of(muscle)).all()
            assert set(point_array(muscle, "FixedTo", name)) == {-1, 0, 1}


def test_muscles_move_with_their_bones_and_keep_their_volume(result):
    for name in result.muscle_names:
        rest = result.rest_muscle(name)
        triangles = triangles_of(rest, name)
        volume = signed_volume(points_of(rest), triangles)
        for i in range(FRAMES):
            points = points_of(result.muscle(name, frame=i))
            assert signed_volume(points, triangles) == pytest.approx(volume, rel=0.01)
            now = result.bones(frame=i).GetBlock(1).GetFieldData().GetArray("Transform")
            transform = np.array([now.GetValue(j) for j in range(16)]).reshape(4, 4)
            held = point_array(rest, "FixedTo", name) == 1
            np.testing.assert_allclose(
                points[held], apply_transform(transform, points_of(rest)[held]), atol=1e-6
            )
    first, last = (points_of(result.muscle("spindle", frame=i)) for i in (0, 4))
    assert np.abs(last - first).max() > 5.0


def test_the_architecture_at_rest_and_smoothed_lengths_are_those_of_the_fibres(result):
    found = result.report["muscles"]["spindle"]["architecture"]
    lengths = polylines_of(result.rest_fibres("spindle"), "fibres").lengths
    rest = result.rest_muscle("spindle")
    volume = signed_volume(points_of(rest), triangles_of(rest, "spindle"))
    assert found["muscle_volume_mm3"] == pytest.approx(volume)
    assert found["pcsa_mm2"] == pytest.approx(volume / lengths.mean())
    assert 0.8 * found["pcsa_mm2"] < found["pcsa_along_line_of_action_mm2"] <= found["pcsa_mm2"]
    assert found["centroid_path_length_mm"] == pytest.approx(lengths.mean(), rel=0.1)
    assert "architecture" not in result.report["muscles"]["plain"]


def test_the_report_says_what_the_geometry_says(result, scene):
    rows = result.report["muscles"]["plain"]["frames"]
    rest = result.rest_muscle("plain")
    triangles = triangles_of(rest, "plain")
    edges = unique_edges(triangles)
    for i, row in enumerate(rows):
        points = points_of(result.muscle("plain", frame=i))
        stretch = edge_lengths(points, edges) / edge_lengths(points_of(rest), edges)
        volume = signed_volume(points, triangles) / signed_volume(points_of(rest), triangles)
        assert (row["frame"], row["time"]) == (i, result.times[i])
        assert row["volume_ratio"] == pytest.approx(volume, rel=1e-12)
        assert row["edge_stretch_max"] == pytest.approx(stretch.max(), rel=1e-12)
        assert row["edge_stretch_p95"] == pytest.approx(np.percentile(stretch, 95), rel=1e-12)
        assert row["fixed_error_max_mm"] < 1e-6
        assert 0 <= row["penetration_p95_mm"] <= row["penetration_max_mm"] < 5
        assert 0 <= row["dihedral_error_p95_deg"] <= 180
    parameters = result.report["muscles"]["spindle"]["parameters"]
    assert parameters["solver"]["iterations"] == 3
    assert parameters["fixing"]["method"] == "attachment"
    assert parameters["fibres"]["n_fibres"] == 6
    fibres = result.report["muscles"]["spindle"]["fibres"]
    assert fibres["points_inside"] + fibres["points_outside"] == fibres["points"] == 6 * 6
    assert fibres["points_inside"] >= 0.95 * fibres["points"]
    assert {"python", "vtk", "numpy", "vtkmuscle"} <= result.report["versions"].keys()
    assert result.report["complete"] is True
    assert np.isfinite(all_numbers(result.report)).all()


def test_penetration_is_measured_in_the_bone_where_it_is_now(scene):
    """A muscle pushed into the moved bone by a known depth."""
    rest = scene.run(frames=0, figures=False).rest_muscle("plain")
    measure = MuscleMeasure(rest, ["upper", "lower"], {"lower": HalfSpace(0.0)}, 10.0)
    assert MuscleMeasure(rest, ["upper", "lower"], {}, 10.0).depths(np.zeros((1, 3)), {}) is None
    free = point_array(rest, "FixedTo", "rest") == -1
    places = points_of(rest)[free, 0]
    few = float(np.percentile(places, 98))  # of the points in the bone, and so no 95th percentile but 0
    for place in (-2.0, few):
        shift = np.eye(4)
        shift[0, 3] = place  # the half space is now x > place
        depths = np.maximum(places - place, 0.0)
        row = measure.frame(points_of(rest), {"lower": shift})
        assert row["penetration_max_mm"] == pytest.approx(10.0 * depths.max())
        assert row["penetration_p95_mm"] == pytest.approx(10.0 * np.percentile(depths, 95))
        assert row["penetrating_points"] == (depths > 0).sum() > 0
    assert np.percentile(depths, 95) == 0.0


# ------------------------------------------------------------------------------- what is written


def test_everything_is_written_and_nothing_else(result, out):
    frames = range(FRAMES)
    assert files(out) == sorted(
        [
            "lengths.csv",
            "fibre_lengths.csv",
            "architecture.csv",
            "spindle_fibres.csv",
            "report.json",
            "report.html",
            "bones.pvd",
            "bones/upper.vtp",
            *(f"bones/lower/lower_{i:04d}.vtp" for i in frames),
            *(f"{name}.pvd" for name in ("spindle", "spindle_fibres", "plain")),
            *(f"{n}/{n}_{i:04d}.vtp" for n in ("spindle", "spindle_fibres", "plain") for i in frames),
            *(f"finished/{name}" for name in ("scene.json", "bones/upper.vtp", "bones/lower.vtp")),
            *(f"finished/{name}" for name in ("spindle.json", "spindle.vtp", "spindle_fibres.vtp")),
            *(f"finished/{name}" for name in ("plain.json", "plain.vtp")),
        ]
    )


def test_what_is_written_is_the_result_bit_for_bit(result, out):
    for name in result.muscle_names:
        reader = pyvista.get_reader(out / f"{name}.pvd")
        assert reader.time_values == result.times
        for i, time in enumerate(result.times):
            reader.set_active_time_value(time)
            np.testing.assert_array_equal(reader.read()[0].points, points_of(result.muscle(name, frame=i)))
    fibres = read_polydata(out / "spindle_fibres/spindle_fibres_0004.vtp")
    np.testing.assert_array_equal(points_of(fibres), points_of(result.fibres("spindle", frame=4)))
    bones = pyvista.get_reader(out / "bones.pvd")
    bones.set_active_time_value(20.0)
    for block, mine in zip(bones.read(), (result.bones(frame=4).GetBlock(i) for i in range(2)), strict=True):
        np.testing.assert_array_equal(block.points, points_of(mine))


def test_the_tables_hold_the_result(result, out):
    with (out / "lengths.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert len(rows) == 6 * FRAMES
    assert list(rows[0]) == ["muscle", "fibre", "frame", "time", "length_mm", "mean_error_mm"]
    for row in rows:
        frame = result.times.index(float(row["time"]))
        assert float(row["length_mm"]) == result.lengths[row["muscle"]][frame, int(row["fibre"])]
    with (out / "spindle_fibres.csv").open(newline="") as lines:
        measured = list(csv.DictReader(lines))
    assert len(measured) == 6 * FRAMES
    for row in measured:
        frame, fibre = result.times.index(float(row["time"])), int(row["fibre"])
        known = result.fibre_lengths["spindle"]
        assert float(row["length_mm"]) == pytest.approx(known[frame, fibre], rel=1e-9)
        rest = known[0, fibre]
        assert float(row["strain"]) == pytest.approx(float(row["length_mm"]) / rest - 1, abs=1e-3)
        assert 0 <= float(row["pennation_origin_deg"]) <= 90
        assert 0 <= float(row["penetration_mm"]) < 5
    report = json.loads((out / "report.json").read_text())
    for row in report["muscles"]["spindle"]["fibre_measures"]:
        lengths = result.fibre_lengths["spindle"][row["frame"]]
        found = [row["length_mm"][word] for word in ("mean", "sd", "min", "max")]
        assert found == pytest.approx([lengths.mean(), lengths.std(), lengths.min(), lengths.max()])
    assert len(report["muscles"]["spindle"]["fibre_measures"]) == FRAMES
    assert report["muscles"]["spindle"]["frames"] == result.report["muscles"]["spindle"]["frames"]
    assert report["seconds"].keys() == {"muscles", "page", "total"}


def test_without_a_folder_nothing_is_written(scene, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = scene.run(frames=0)
    assert files(tmp_path) == []
    for data in (result.fibres("spindle", frame=0), *result.rest_bones(), *result.bones(frame=0)):
        data.points *= 0.0  # whose they are alone
    for data in (result.fibres("spindle", frame=0), *result.rest_bones(), *scene.bones.values()):
        assert np.ptp(points_of(data)) > 1.0


# ------------------------------------------------------------------------------- options


def test_frames_are_the_same_whichever_are_kept_by_number_and_by_time(result, scene, tmp_path):
    asked = []
    some = scene.run(tmp_path, frames="2:5:2", figures=False, progress=lambda *args: asked.append(args))
    assert (some.frames, some.times) == ([2, 4], [10.0, 20.0])
    for by in ({"frame": 2}, {"frame": 4}, {"time": 20.0}):
        surfaces = [[one.muscle(name, **by).points for name in some.muscle_names] for one in (some, result)]
        np.testing.assert_allclose(*surfaces, rtol=0.0, atol=SOLVED)
        fibres = [one.fibres("spindle", **by).points for one in (some, result)]
        np.testing.assert_allclose(*fibres, rtol=0.0, atol=SOLVED)
        assert some.bones(**by).keys() == ["upper", "lower"]
    whole = result.lengths["spindle"][2:5:2]
    np.testing.assert_allclose(some.lengths["spindle"], whole, rtol=0.0, atol=SOLVED)
    assert [row["frame"] for row in some.report["muscles"]["plain"]["frames"]] == [2, 4]
    assert {path.name for path in (tmp_path / "spindle").iterdir()} == {
        "spindle_0002.vtp",
        "spindle_0004.vtp",
    }
    # No frame beyond those asked for was computed.
    assert sum(args[:2] == ("plain", "deforming") for args in asked) == 2


def test_frames_are_counted_as_in_python():
    every = list(range(46))
    for frames in (":", "0:10", "40:", ":3", "0:46:5", "-2:", "40:99"):
        expected = every[slice(*(int(part) if part else None for part in frames.split(":")))]
        assert list(frame_numbers(frames, 46)) == expected, frames
    for frames, expected in ((None, every), ("7", [7]), (7, [7])):
        assert list(frame_numbers(frames, 46)) == expected


ODD_FRAMES = [
    *["5:5", "9:3", "46", "a", "1:b", "1:2:3:4", "5:1:-1", "50:60", "1:5:0"],
    "",
    46,
    -1,
    range(40, 50),
    [1, 3],
    1.5,
]


@pytest.mark.parametrize("frames", [*ODD_FRAMES, slice(5, 1, -1)])
def test_frames_that_do_not_exist_are_refused(frames):
    with pytest.raises(ValueError, match=r"frames .*; give A:B .* 0 <= A < B <= 46 \(B is not included\)"):
        frame_numbers(frames, 46)


@pytest.mark.parametrize("unit", ["cm", *slow("m")])
def test_a_scene_in_another_unit_reports_the_same_millimetres(unit):
    flexor, factor = Scene.from_phantom(flexor_over_brim(), n_fibres=6, resolution=6), 1.0 / MILLIMETRES[unit]
    settings = {"solver": {"bone_clearance": 1.0}, "fixing": {"method": "proximity", "distance": 3.0}}
    smaller = {
        "solver": {"bone_clearance": factor},
        "fixing": {"method": "proximity", "distance": 3.0 * factor},
    }
    muscle = replace(flexor.muscles["flexor"], hill={"tendon_slack_length": 20.0}, **settings)
    scene = replace(flexor, muscles={"flexor": muscle})
    other = mapped(scene, scale=factor, units=unit)
    other = replace(other, muscles={"flexor": replace(other.muscles["flexor"], **smaller)})
    result, same = (one.run(frames="::8") for one in (scene, other))
    assert same.verdicts == result.verdicts
    np.testing.assert_allclose(same.lengths["flexor"], result.lengths["flexor"], rtol=1e-9)
    np.testing.assert_allclose(same.fibre_lengths["flexor"], result.fibre_lengths["flexor"], rtol=1e-9)
    for frame in result.frames:
        points = MILLIMETRES[unit] * points_of(same.muscle("flexor", frame=frame))
        np.testing.assert_allclose(points, points_of(result.muscle("flexor", frame=frame)), atol=1e-8)
    mine, yours = (one.report["muscles"]["flexor"] for one in (result, same))
    for quantity, value in mine["architecture"].items():
        if isinstance(value, float):
            assert yours["architecture"][quantity] == pytest.approx(value, rel=1e-6, abs=1e-8), quantity
    for row, other_row in zip(mine["frames"], yours["frames"], strict=True):
        for key in row.keys() - {"ms", "ms_fibres", "penetrating_points"}:
            assert other_row[key] == pytest.approx(row[key], rel=1e-6, abs=1e-8), key


# ------------------------------------------------------------------------------- faults


def finished(folder, name):
    """Return the times of the frames that a folder lists, having read each."""
    reader = pyvista.get_reader(folder / f"{name}.pvd")
    for time in reader.time_values:
        reader.set_active_time_value(time)
        assert reader.read()[0].n_points
    return reader.time_values


@pytest.mark.parametrize(
    "error", [InputError("", "bad shape", "try another"), RuntimeError("a fault"), MemoryError()]
)
def test_a_fault_in_a_frame_leaves_the_finished_ones(error, scene, tmp_path, monkeypatch):
    whole = MuscleMeasure.frame

    def failing(self, points, transforms):
        row = whole(self, points, transforms)
        failing.calls += 1
        if failing.calls == 3:
            raise error
        return row

    failing.calls = 0
    monkeypatch.setattr(MuscleMeasure, "frame", failing)
    expected = SceneError if isinstance(error, ValueError) else type(error)
    with pytest.raises(expected) as caught:
        scene.run(tmp_path, workers=1, figures=False)
    if expected is SceneError:
        assert (caught.value.key, caught.value.remedy) == ("muscles.spindle", "try another")
        assert caught.value.__cause__ is error
    assert finished(tmp_path, "spindle") == [0.0, 5.0]
    assert finished(tmp_path, "spindle_fibres") == [0.0, 5.0]
    assert not [name for name in files(tmp_path) if "partial" in name]
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["complete"] is False
    assert report["stopped_by"].startswith(expected.__name__)
    assert not (tmp_path / "lengths.csv").exists()  # no muscle is finished


def test_a_failure_of_a_filter_names_the_muscle(scene):
    far = replace(scene, fixing={"method": "proximity", "distance": 1e-9})
    with pytest.raises(SceneError, match=r"scene\.toml: muscles\.(spindle|plain): FixedPointDetector"):
        far.run()


# ------------------------------------------------------------------------------- real data


@pytest.mark.slow
@pytest.mark.realdata
def test_the_main_job_on_the_real_hip(lhdl_hip):
    """Four muscles at full resolution over 90 degrees of flexion, with the settings of the scene."""
    result = Scene.load(lhdl_hip / "scene.toml").run()
    assert result.report["complete"]
    assert np.isfinite(all_numbers(result.report)).all()
    assert len(result.muscle_names) == 4
    for name in result.muscle_names:
        report = result.report["muscles"][name]
        assert len(report["frames"]) == 46
        assert set(report["fixed_points"]) == {"pelvis", "femur_r"}
        assert report["fibres"]["points_inside"] >= 0.95 * report["fibres"]["points"]
        for row in report["frames"]:
            assert row["volume_ratio"] == pytest.approx(1.0, abs=1e-3)
            assert row["fixed_error_max_mm"] < 1e-6
            assert row["penetration_p95_mm"] <= 0.1
            assert row["penetration_max_mm"] <= 0.5
            assert row["fibres_outside_max_mm"] <= 0.1
        for i in (0, 22, 45):
            assert np.isfinite(points_of(result.muscle(name, frame=i))).all()
            assert np.isfinite(points_of(result.fibres(name, frame=i))).all()
    (arms,) = result.moment_arms()["iliacus"].values()
    assert 20.0 < arms.mean.min() < arms.mean.max() < 40.0  # the literature has about 30 mm in flexion
    # The iliacus gets shorter; where it may not give way along its fibres it coils up like a spring.
    rest, bent = (cell_array(result.fibres("iliacus", frame=i), "Tortuosity", "iliacus") for i in (0, 45))
    assert (bent / rest).max() < 1.15
