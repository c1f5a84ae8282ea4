"""The study of speed against accuracy: what it compares, what it writes, and that nothing is run twice."""

import csv
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from tiny_scene import write_tiny_scene
from typer.testing import CliRunner

from vtkmuscle import Scene
from vtkmuscle.cli import app
from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.data.arrays import Polylines, points_of, polylines_from, surface_from, triangles_of
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.filters.deformer.quality import PRESETS
from vtkmuscle.io.parts import Parts
from vtkmuscle.tradeoff import plots, trade_off, write_plots, write_tables
from vtkmuscle.tradeoff import study as study_module
from vtkmuscle.tradeoff.measures import ERRORS, MEASURES, measured
from vtkmuscle.tradeoff.plots import FORMATS, front
from vtkmuscle.tradeoff.records import Records
from vtkmuscle.tradeoff.settings import AS_IT_IS, Setting, grid
from vtkmuscle.tradeoff.study import chosen
from vtkmuscle.tradeoff.trial import Trial, thinned, tried, trimmed_mean


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return Scene.load(write_tiny_scene(tmp_path_factory.mktemp("scene")))


@pytest.fixture(autouse=True)
def _short_reference(monkeypatch):
    monkeypatch.setattr(study_module, "FIRST_ITERATIONS", 50)


@pytest.fixture(scope="module")
def done(scene, tmp_path_factory):
    out = tmp_path_factory.mktemp("study")
    settings = [Setting(f"iterations={n}", "iterations", {"iterations": n}) for n in (1, 3, 10)]
    settings += [Setting("preview", "presets", {"quality": "preview"}), Setting("every=2", "every", every=2)]
    settings += [
        Setting("few fibres", "n_fibres", {}, {"n_fibres": 3}),
        Setting("pruned", "weight_tolerance", {}, {"weight_tolerance": 1.0}),
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study_module, "FIRST_ITERATIONS", 50)
        patch.setattr(study_module, "grid", lambda: settings)
        return out, trade_off(scene, out, compared=range(len(scene.motion.times)))


def with_everything(scene):
    """Return the scene with another muscle to meet, superficial fibres, a via ring and merged weights."""
    spindle = scene.muscles["spindle"]
    points = points_of(spindle.surface)
    heights = np.linspace(-15.0, 15.0, 7)
    radius = 8.0 * np.sqrt(1 - (heights / 40.0) ** 2)
    seen = np.column_stack([radius * np.cos(0.01 * heights), radius * np.sin(0.01 * heights), heights])
    angles = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    ring = np.column_stack([9 * np.cos(angles), 9 * np.sin(angles), np.zeros(8)])
    aside = np.array([7.0, -4.0, 0.0])
    beside = surface_from(points + aside, triangles_of(spindle.surface, "spindle"))
    moved = tuple(replace(area, landmarks=area.landmarks + aside) for area in spindle.attachments)
    fibres = {**spindle.fibres, "weight_tolerance": 0.9}
    seen_fibres = polylines_from(Polylines(seen, np.array([0, len(seen)])))
    muscles = {
        "spindle": replace(
            spindle,
            attachments=(*spindle.attachments, AttachmentArea("via", "upper", ring, closed=True)),
            fibres=fibres,
            superficial_fibres=seen_fibres,
        ),
        "beside": replace(spindle, surface=beside, attachments=moved, fibres=fibres),
    }
    motion = hinge("lower", (0, -15, 0), (1, 0, 0), [0, 5, 10])
    return replace(scene, muscles=muscles, motion=motion, muscle_contact="on", solver={})


def test_a_study_measures_the_scene_that_a_run_runs(scene, tmp_path, monkeypatch):
    whole = with_everything(scene)
    settings = [Setting(AS_IT_IS, AS_IT_IS, None), Setting("defaults", "presets", {})]
    monkeypatch.setattr(study_module, "grid", lambda: settings)
    monkeypatch.setattr(study_module, "FIRST_ITERATIONS", 2)
    monkeypatch.setattr(study_module, "MOST_ITERATIONS", 4)
    study = trade_off(whole, tmp_path, compared=range(3))
    run = whole.run(figures=False)
    for row in study.rows[:2]:
        for name in whole.muscles:
            frames = row.figures["muscles"][name]["frames"]
            lengths = [frame["length_mm"] for frame in frames]
            np.testing.assert_array_equal(lengths, run.fibre_lengths[name].mean(axis=1))
    alone = replace(whole, muscles={"spindle": scene.muscles["spindle"]}).run(figures=False)
    assert np.abs(alone.fibre_lengths["spindle"] - run.fibre_lengths["spindle"]).max() > 0.01
    # A muscle that may meet others meets them, whichever are asked for.
    only = tried(whole, settings[0], [0, 1, 2], ["beside"])["beside"]
    np.testing.assert_array_equal(only.lengths, run.fibre_lengths["beside"])


def test_a_muscle_that_fails_has_no_figures(scene, monkeypatch):
    trials = tried(scene, Setting("any", "any", {"iterations": 2}), [0, 2], ["spindle"])
    figures = measured({"spindle": trials["spindle"], "other": None}, {**trials, "other": trials["spindle"]})
    assert set(figures["all"].values()) == {None}
    assert figures["muscles"]["spindle"]["rms_mm"] == 0.0
    assert figures["muscles"]["other"]["rms_mm"] is None


def test_a_scene_of_paths_is_refused(scene, tmp_path):
    with pytest.raises(ValueError, match="model is 'paths'"):
        trade_off(replace(scene, model="paths", solver={}), tmp_path)


def test_every_setting_of_the_grid_can_be_made_and_has_a_name_of_its_own(scene):
    settings = grid()
    names = [setting.name for setting in settings]
    assert len(set(names)) == len(names)
    assert [setting.name for setting in settings[: len(PRESETS)]] == list(PRESETS)
    muscle = scene.muscles["spindle"]
    for setting in settings:
        fibres = replace(muscle, fibres={**muscle.fibres, **setting.fibres})
        replace(scene, solver=setting.solver or {}, muscles={"spindle": fibres})  # raises for what is wrong
        if "=" in setting.name and "," not in setting.name:
            name, value = setting.name.split("=")
            assert str({**setting.plain(), **setting.solver, **setting.fibres}[name]) == value


def test_more_iterations_come_nearer_to_the_reference_which_has_converged(done):
    _, study = done
    rms = {row.setting.name: row.figures["all"]["rms_mm"] for row in study.rows}
    assert rms["iterations=1"] > rms["iterations=3"] > rms["iterations=10"]
    assert study.rows[-1].setting.group == "reference"
    assert study.rows[-1].figures["all"]["rms_mm"] == 0.0
    assert [doubling.muscle for doubling in study.doublings] == ["spindle"]
    assert study.doublings[-1].converged
    assert study.doublings[-1].rms_mm <= study_module.CONVERGED
    for row in study.rows:
        figures = row.figures["all"]
        assert figures["max_mm"] >= figures["worst_rms_mm"] >= figures["rms_mm"] * (1 - 1e-12)
        assert figures["volume_error_pct"] < 1e-6
        assert figures["ms_per_frame"] > 0


def test_nothing_is_run_twice_and_what_is_lost_is_run_again(done, scene, monkeypatch):
    out, study = done
    ran = []

    def counted(scene, setting, *rest, **more):
        ran.append(setting.name)
        return tried(scene, setting, *rest, **more)

    monkeypatch.setattr(study_module, "tried", counted)
    compared = range(len(scene.motion.times))
    settings = [row.setting for row in study.rows[:-1]]
    monkeypatch.setattr(study_module, "grid", lambda: settings)
    again = trade_off(scene, out, compared=compared)
    assert ran == []
    assert [row.figures for row in again.rows] == [row.figures for row in study.rows]
    (lost,) = [
        file
        for file in (out / "settings").glob("*.npz")
        if Parts(file.parent).read(file.stem).facts.get("key", [None])[0] == settings[1].plain()
    ]
    lost.unlink()
    trade_off(scene, out, compared=compared)
    assert ran == [settings[1].name]
    assert not list((out / "settings").glob(".*"))


def test_records_are_not_kept_through_links(scene, tmp_path):
    (tmp_path / "settings").symlink_to(tmp_path)
    with pytest.raises(NotADirectoryError, match=r"settings is a link to .*not written through links"):
        Records(tmp_path / "settings", scene, [0])


def test_each_muscle_has_iterations_of_its_own_in_the_reference(monkeypatch, tmp_path, scene):
    """One muscle has converged after the first doubling, one after the third, one does not at all."""
    still = {"a": 0, "b": 400, "c": 10_000}
    monkeypatch.setattr(study_module, "FIRST_ITERATIONS", 100)
    monkeypatch.setattr(study_module, "MOST_ITERATIONS", 1600)
    ran = []

    def run(setting, names, *, iterations):
        ran.append(list(names))
        frame = {"time": 0.0, "volume_ratio": 1.0}
        at = {name: np.full((1, 2, 3), float(min(iterations[name], still[name]))) for name in names}
        return {name: Trial(at[name], np.empty((1, 0)), [frame], 1.0, 0.0, 0.0) for name in names}

    records = Records(tmp_path, scene, [0])
    exact, doublings = study_module._reference(run, list(still), records, lambda words: None)
    assert [d.iterations for d in doublings] == [200, 800, 1600]
    assert [d.converged for d in doublings] == [True, True, False]
    assert [exact[name].points[0, 0, 0] for name in still] == [0.0, 400.0, 1600.0]
    assert ran == [["a", "b", "c"], ["a", "b", "c"], ["b", "c"], ["b", "c"], ["c"]]


def test_the_key_tells_scenes_frames_settings_and_code_apart(scene, tmp_path, monkeypatch):
    def key(scene=scene, frames=(0, 1), **setting):
        return Records(tmp_path, scene, frames).name(Setting("any", "any", **setting).plain())

    whole = with_everything(scene)
    keys = [key(), key(frames=(0, 2)), key(fibres={"weight_tolerance": 1.0}), key(solver={"iterations": 2})]
    keys.append(key(replace(scene, solver={"stiffness": 0.5})))
    keys.append(key(replace(scene, motion=thinned(scene.motion, 2, 2))))
    keys += [key(whole), key(replace(whole, muscle_contact="off")), key(replace(whole, quality="preview"))]
    spindle = whole.muscles["spindle"]
    seen = polylines_from(Polylines(points_of(spindle.superficial_fibres) * 1.001, np.array([0, 7])))
    for change in ({"attachments": spindle.attachments[:2]}, {"superficial_fibres": seen}, {"fibres": None}):
        muscles = {**whole.muscles, "spindle": replace(spindle, **change)}
        keys.append(key(replace(whole, muscles=muscles)))
    keys.append(key(replace(whole, muscles=dict(reversed(whole.muscles.items())))))
    assert key(with_everything(scene)) == key(whole)
    monkeypatch.setattr("vtkmuscle.tradeoff.records.code_digest", lambda: "other")
    keys.append(key())
    assert len(set(keys)) == len(keys)


def test_tables_and_plots_have_all_settings_and_can_be_read(done, monkeypatch):
    out, study = done
    # One with a logarithm and one without; the test of the command draws them all.
    drawn = [measure for measure in ERRORS if measure.name in ("rms_mm", "edge_stretch_p95")]
    monkeypatch.setattr(plots, "ERRORS", drawn)
    paths = write_tables(out, study) + write_plots(out, study)
    names = {path.name for path in paths}
    plotted = [f"pareto_{measure.name}" for measure in drawn]
    assert names == {"tradeoff.csv", "tradeoff.md"} | {
        f"{name}.{kind}" for name in plotted for kind in FORMATS
    }
    with (out / "tradeoff.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["setting"] for row in rows if row["muscle"] == "all"] == [r.setting.name for r in study.rows]
    assert {row["muscle"] for row in rows} == {"all", "spindle"}
    for row, kept in zip(rows, study.rows, strict=False):
        assert float(row["rms_mm"]) == pytest.approx(kept.figures["all"]["rms_mm"], rel=1e-5)
    text = (out / "tradeoff.md").read_text()
    assert all(f"\n| {row.setting.name} |" in text for row in study.rows)
    for path in paths:
        if path.suffix == ".svg":
            assert ElementTree.parse(path).getroot().tag.endswith("svg")
    before = (out / "pareto_rms_mm.svg").read_bytes()
    monkeypatch.setattr(plots, "ERRORS", drawn[:1])
    write_plots(out, study)
    assert (out / "pareto_rms_mm.svg").read_bytes() == before


def test_measures_of_a_known_difference():
    def trial(shift, lengths, depth):
        frames = [
            {
                "time": time,
                "volume_ratio": 1.0 + shift,
                "edge_stretch_p95": 1.1,
                "edge_stretch_max": 2.0,
                "dihedral_error_p95_deg": 3.0,
                "penetration_p95_mm": depth,
                "penetration_max_mm": depth,
            }
            for time in (0.0, 1.0)
        ]
        points = np.zeros((2, 4, 3))
        points[1, :, 0] = shift
        return Trial(points, np.array(lengths), frames, 5.0, 1.0, 2.0)

    exact = {"a": trial(0.0, [[10.0, 20.0]] * 2, None), "b": trial(0.0, [[1.0, 1.0]] * 2, 0.0)}
    other = {"a": trial(3.0, [[16.0]] * 2, None), "b": trial(4.0, [[1.0, 1.0]] * 2, 0.5)}
    figures = measured(other, exact)
    assert figures["all"]["rms_mm"] == pytest.approx(2.5)  # sqrt of the mean of 9/2 and 16/2
    assert figures["all"]["worst_rms_mm"] == pytest.approx(4 / np.sqrt(2))
    assert figures["all"]["max_mm"] == 4.0
    assert figures["all"]["ms_per_frame"] == 10.0
    assert figures["all"]["volume_error_pct"] == pytest.approx(400.0)
    assert figures["all"]["penetration_max_mm"] == 0.5
    assert figures["muscles"]["a"]["penetration_max_mm"] is None
    assert figures["all"]["dihedral_p95_deg"] == 3.0
    assert figures["all"]["fibre_length_mm"] == pytest.approx(1.0)
    frames = figures["muscles"]["a"]["frames"]
    assert [frame["rms_mm"] for frame in frames] == [0.0, 3.0]
    assert [frame["length_mm"] for frame in frames] == [16.0, 16.0]
    assert {measure.name for measure in MEASURES} == set(figures["all"])


def test_front_and_means():
    assert front([3.0, 1.0, 2.0, 4.0], [1.0, 5.0, 6.0, 1.0]) == [1, 0]
    assert trimmed_mean([1.0] * 18 + [100.0, 0.0]) == 1.0
    assert trimmed_mean([3.0]) == 3.0


def test_thinned_motions_end_where_they_did(scene):
    motion = thinned(scene.motion, 2, 3)
    np.testing.assert_array_equal(motion.times, scene.motion.times[[0, 2, 3]])
    for bone, pose in motion.at(motion.times[-1]).items():
        np.testing.assert_array_equal(pose, scene.motion.at(scene.motion.times[3])[bone])


def test_settings_are_chosen_by_group_or_name():
    settings = grid()
    assert [s.name for s in chosen(settings, ["presets"])] == ["preview", "balanced", "accurate"]
    assert {s.group for s in chosen(settings, ["iterations", "weight_tolerance=1"])} == {
        "iterations",
        "weight_tolerance",
    }
    with pytest.raises(
        ValueError, match=r"no setting is called 'iteratons'; there are groups presets, published"
    ):
        chosen(settings, ["iteratons"])


def test_the_command_says_what_it_found_and_refuses_an_unknown_muscle(tmp_path):
    file = write_tiny_scene(tmp_path / "scene")
    arguments = [
        "tradeoff",
        str(file),
        "--out",
        str(tmp_path / "out"),
        "--only",
        "presets",
        "--frames",
        "0:3",
    ]
    run = CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert run.exit_code == 0, run.output
    assert "spindle: 100 iterations instead of 50 move the reference by" in run.output
    assert (tmp_path / "out/tradeoff.md").read_text().count("\n| ") == 5
    drawn = {path.name for path in (tmp_path / "out").glob("pareto_*")}
    assert drawn == {f"pareto_{measure.name}.{kind}" for measure in ERRORS for kind in FORMATS}
    refused = CliRunner().invoke(app, [*arguments, "--muscle", "psoas"], catch_exceptions=False)
    assert refused.exit_code == 2
