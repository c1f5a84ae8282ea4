"""Runs that go on where an earlier one stopped, and results read back from their folders."""

import json
import os
import shutil
from collections.abc import Mapping
from copy import copy
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from faults import check_whole, results
from slow import slow
from tiny_scene import write_tiny_scene
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle import InputError, Result, Scene, SceneError
from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.data.arrays import add_arrays, points_of, with_points
from vtkmuscle.data.attachments import Aponeurosis, AttachmentArea
from vtkmuscle.io import LiteratureCurve
from vtkmuscle.run import store
from vtkmuscle.run.muscles import MuscleRun
from vtkmuscle.run.store import IRRELEVANT, muscle_keys
from vtkmuscle.scene.data import Muscle, SceneData

SHEET = np.array([[0, 1, 2]])


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Two muscles, the second one narrower, with fibres; a third without."""
    one = Scene.load(write_tiny_scene(tmp_path_factory.mktemp("scene")))
    spindle = one.muscles["spindle"]
    thin = replace(
        spindle, surface=with_points(spindle.surface, points_of(spindle.surface) * (0.9, 0.9, 1.0))
    )
    bare = replace(thin, fibres=None)
    motion = replace(one.motion, coordinates={"angle": Coordinate(one.motion.times, "deg", "flexion")})
    return replace(one, muscles={"spindle": spindle, "thin": thin, "bare": bare}, motion=motion, files={})


@pytest.fixture
def computed(noted):
    """The muscles that are computed, in order."""
    return noted(MuscleRun, "go", lambda run: run.name)


def run(scene, out, **more):
    return scene.run(out, figures=False, workers=1, **more)


@pytest.fixture(scope="module")
def finished_once(scene, tmp_path_factory):
    """The folder of a finished run, from which each test has a copy."""
    out = tmp_path_factory.mktemp("finished")
    run(scene, out)
    return out


@pytest.fixture
def finished(finished_once, tmp_path):
    """A folder of a finished run."""
    return Path(shutil.copytree(finished_once, tmp_path / "finished"))


def same(one, other):
    """Check that two results are the same bit by bit."""
    for name in ("name", "units", "frames", "times", "verdicts", "time_label", "muscle_names"):
        assert getattr(one, name) == getattr(other, name)
    for name in one.muscle_names:
        assert one.rest_muscle(name) == other.rest_muscle(name)
        assert one.rest_fibres(name) == other.rest_fibres(name)
        for frame in one.frames[: one.finished(name)]:
            assert one.fibres(name, frame=frame) == other.fibres(name, frame=frame)
            if one.report["deformer"] != "none":
                assert one.muscle(name, frame=frame) == other.muscle(name, frame=frame)
    for frame in one.frames:
        for bone, moved in zip(one.bones(frame=frame), other.bones(frame=frame), strict=True):
            assert bone == moved
    assert one.lengths.keys() == other.lengths.keys()
    for name, lengths in one.lengths.items():
        np.testing.assert_array_equal(lengths, other.lengths[name])
    for name, table in one.tables().items():
        for column, values in table.items():
            np.testing.assert_array_equal(values, other.tables()[name][column])


@pytest.mark.parametrize("deformer", ["paths", *slow("none")])
def test_a_result_that_is_read_back_is_what_the_run_gave(scene, tmp_path, deformer):
    muscles = {name: one for name, one in scene.muscles.items() if deformer == "paths" or one.fibres}
    solver = scene.solver if deformer == "paths" else {}
    result = run(replace(scene, deformer=deformer, muscles=muscles, solver=solver), tmp_path, frames="1:5")
    loaded = Result.load(tmp_path)
    same(result, loaded)
    assert loaded.report == json.loads((tmp_path / "report.json").read_text())
    assert list(loaded.report) == list(result.report)


def test_a_folder_without_a_finished_run_is_one_clear_error(scene, finished, tmp_path):
    def refused(folder, words):
        with pytest.raises(InputError, match=words):
            Result.load(folder)

    refused(tmp_path / "none", "there is no such folder")
    refused(tmp_path, "no results of a run")
    (tmp_path / "file").write_text("")
    refused(tmp_path / "file", "this is a file")

    def stop(muscle, stage, part):
        if part > 0.0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(scene, tmp_path / "out", progress=stop)
    refused(tmp_path / "out", r"an unfinished run \(KeyboardInterrupt\); finished frames")
    out = finished
    for damage, words in (
        (lambda file: file.unlink(), "missing"),
        (lambda file: file.write_bytes(file.read_bytes()[:-9]), "is not what the run|damaged"),
    ):
        finished = ("thin.json", "thin_fibres.vtp", "scene.json", "bones/lower.vtp")
        kept_files = [f"finished/{file}" for file in finished]
        for name in ("thin.pvd", "thin/thin_0001.vtp", *kept_files, "report.json"):
            kept = (out / name).read_bytes()
            damage(out / name)
            with pytest.raises(InputError, match=words if name != "report.json" else "report"):
                Result.load(out)
            (out / name).write_bytes(kept)
    Result.load(out)


@pytest.mark.parametrize("name", ["scene", "thin"])
def test_notes_of_another_version_and_damaged_notes_are_one_clear_error(finished, name, monkeypatch):
    file = finished / "finished" / f"{name}.json"
    content = json.loads(file.read_text())
    for changed, words in (
        ({**content, "format": store.FORMAT + 1}, "of another version of vtkmuscle .format 8, not 7"),
        ({**content, "another": 1}, "the file is damaged; run the scene again"),
        ({key: value for key, value in content.items() if key != "files"}, "the file is damaged"),
        ({**content, "files": {"../../report.json": 1}}, "the file is damaged"),
        ([], "the file is damaged"),
    ):
        file.write_text(json.dumps(changed))
        with pytest.raises(InputError, match=words) as failure:
            Result.load(finished)
        assert len(str(failure.value).splitlines()) == 1


def test_what_is_finished_is_not_computed_again_and_what_is_changed_is_computed_alone(
    scene, finished, computed
):
    whole = results(finished)
    stamps = {path: os.stat(path).st_mtime_ns for path in finished.rglob("*.vtp") if "bones" not in str(path)}
    again = run(scene, finished)
    assert computed == []
    assert again.report["taken_over"] == ["spindle", "thin", "bare"]
    assert results(finished) == whole
    assert {path: os.stat(path).st_mtime_ns for path in stamps} == stamps
    same(again, Result.load(finished))

    thin = replace(scene.muscles["thin"], solver={"iterations": 4})
    changed = replace(scene, muscles={**scene.muscles, "thin": thin})
    run(changed, finished)
    assert computed == ["thin"]
    computed.clear()
    run(changed, finished, fresh=True)
    assert computed == ["spindle", "thin", "bare"]


def variants(value):
    """Give the path of each thing that a scene is made of, and the scene with that thing alone changed."""
    if is_dataclass(value):
        for field in fields(value):
            for path, one in variants(getattr(value, field.name)):
                changed = copy(value)
                object.__setattr__(changed, field.name, one)
                yield f"{type(value).__name__}.{field.name}/{path}", changed
    elif isinstance(value, Mapping) and value:
        for key, held in value.items():
            yield from ((path, {**value, key: one}) for path, one in variants(held))
        yield "without", dict(list(value.items())[1:])
    elif isinstance(value, tuple) and value:
        for number, held in enumerate(value):
            for path, one in variants(held):
                yield path, (*value[:number], one, *value[number + 1 :])
        yield "without", value[1:]
    elif isinstance(value, vtkPolyData):
        yield "points", with_points(value, points_of(value) + 1e-12)
        named = vtkPolyData()
        named.ShallowCopy(value)
        add_arrays(named, fields={"Mine": np.ones(1)})
        yield "arrays", named
    elif isinstance(value, np.ndarray | bool | int | float):
        yield "number", value == 0 if isinstance(value, bool) else value * 2 + 1
    else:  # a text, a path, or nothing yet
        yield "text", "another"


def test_every_field_of_a_scene_is_in_the_key_or_named_as_irrelevant(scene):
    """A field that is added later counts as well, or says why it does not."""
    curve = LiteratureCurve("A", "whole", "angle", "", np.arange(3.0), np.arange(3.0))
    whole = replace(
        scene.muscles["thin"],
        solver={"iterations": 4, "quality": "preview"},
        fixing={"distance": 2.0},
        superficial_fibres=scene.muscles["thin"].surface,
        literature=(curve,),
        crosses=("angle",),
        hill={"tendon_slack_length": 20.0},
        aponeuroses=(sheet("distal", -15.0),),
    )
    given = {"solver": {"iterations": 3}, "fixing": {"n_voxels": 9}, "files": {"": Path("a.toml")}}
    fields_of = {field.name: getattr(scene, field.name) for field in fields(SceneData)}
    data = SceneData(**{**fields_of, **given, "muscles": {"whole": whole}})
    before, counted = muscle_keys(data, range(5)), set()
    for path, changed in variants(data):
        irrelevant = not {*IRRELEVANT}.isdisjoint(path.split("/"))
        assert (muscle_keys(changed, range(5)) == before) == irrelevant, path
        counted.update(path.split("/"))
    kinds = (SceneData, Muscle, AttachmentArea, Aponeurosis, RigidMotion, Coordinate)
    assert counted >= {f"{kind.__name__}.{field.name}" for kind in kinds for field in fields(kind)}


def sheet(side, height):
    """Return an aponeurosis across the muscle at a height."""
    return Aponeurosis(side, np.array([[5.0, 0, height], [-3, 4, height], [-3, -4, height]]), SHEET)


def test_a_template_file_counts_by_its_content(scene, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("one")
    fibres = {"template_file": str(file)}
    data = replace(scene, muscles={"thin": replace(scene.muscles["thin"], fibres=fibres)})
    before = muscle_keys(data, range(5))
    file.write_text("two")
    assert muscle_keys(data, range(5)) != before


@pytest.mark.slow
def test_a_muscle_whose_files_are_not_whole_is_computed_again(scene, finished, computed):
    whole = results(finished)
    for name in ("thin/thin_0002.vtp", "finished/thin.json", "finished/thin.vtp"):
        file = finished / name
        file.write_bytes(file.read_bytes()[:-9])
        computed.clear()
        run(scene, finished)
        assert computed == ["thin"]
        assert results(finished) == whole
    check_whole(finished)


@pytest.mark.filterwarnings("ignore:.*of the muscle lies in the muscle")  # one surface, twice
@pytest.mark.parametrize("contact", ["off", *slow("measure")])
def test_a_run_that_was_stopped_goes_on_and_gives_the_same(scene, finished, tmp_path, computed, contact):
    scene = replace(scene, muscle_contact=contact)
    run(scene, finished)

    def stop(muscle, stage, part):
        if muscle == "thin" and part > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(scene, tmp_path / "out", progress=stop)
    computed.clear()
    result = run(scene, tmp_path / "out")
    # Where muscles may meet, each asks those before it where they are.
    assert computed == (["thin", "bare"] if contact == "off" else ["spindle", "thin", "bare"])
    assert results(tmp_path / "out") == results(finished)
    same(result, Result.load(finished))


def test_a_result_says_where_its_frames_were_lost_or_changed(scene, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    one = scene.with_muscles("thin")
    result = run(one, "out", frames="0:2", report=False)
    monkeypatch.chdir("/")
    assert result.fibres("thin", frame=1).n_cells == result.lengths["thin"].shape[1]
    frame = tmp_path / "out" / "thin_fibres" / "thin_fibres_0001.vtp"
    other = replace(one, name="another")
    for change, words in (
        (lambda: frame.write_bytes(frame.read_bytes() + b" "), "not what the run"),
        (frame.unlink, "missing"),
        (
            lambda: run(other, tmp_path / "out", frames="0:2", report=False, overwrite=True),
            "not what the run",
        ),
    ):
        change()
        with pytest.raises(
            InputError, match=rf"thin_fibres_0001\.vtp: the file is {words}.*run the scene again"
        ):
            result.fibres("thin", frame=1)
    assert len(result.length_table()["length_mm"])


def test_sense_is_not_checked_where_that_is_asked_for(scene):
    turned = scene.motion.transforms["lower"].copy()
    turned[1:, 0, 3] += 1e6
    motion, muscles = (
        RigidMotion(scene.motion.times, {"lower": turned}),
        {"spindle": scene.muscles["spindle"]},
    )
    lost = replace(scene, motion=motion, muscles=muscles, deformer="none", solver={})
    with pytest.raises(SceneError, match="farther apart"):
        lost.run(frames="0:1")
    assert len(lost.run(frames="0:1", sense=False).times) == 1


def test_a_report_of_another_version_is_one_error(finished):
    """Also where its note's digest fits, as of results that an earlier version has finished."""
    for number in (None, store.FORMAT - 1):
        report = json.loads((finished / "report.json").read_text()) | {"format": number}
        (finished / "report.json").write_text(json.dumps(report))
        with pytest.raises(
            InputError, match=rf"report\.json: .* \(format {number}, not {store.FORMAT}\); run"
        ):
            Result.load(finished)
