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
from vtkmuscle.filters.deformer.quality import PRESETS
from vtkmuscle.tradeoff import plots, trade_off, write_plots, write_tables
from vtkmuscle.tradeoff import study as study_module
from vtkmuscle.tradeoff.estimates import estimates, estimates_in_words
from vtkmuscle.tradeoff.measures import ERRORS, MEASURES, measured
from vtkmuscle.tradeoff.memory import peak_memory
from vtkmuscle.tradeoff.plots import FORMATS, front
from vtkmuscle.tradeoff.records import Records
from vtkmuscle.tradeoff.settings import Setting, grid
from vtkmuscle.tradeoff.study import chosen
from vtkmuscle.tradeoff.trial import Bench, MuscleTrial, Trial, thinned, trimmed_mean


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return Scene.load(write_tiny_scene(tmp_path_factory.mktemp("scene")))


@pytest.fixture(autouse=True)
def _short_reference(monkeypatch):
    monkeypatch.setattr(study_module, "FIRST_ITERATIONS", 50)


@pytest.fixture(scope="module")
def done(scene, tmp_path_factory):
    out = tmp_path_factory.mktemp("study")
    settings = [
        Setting(f"iterations={n}", "iterations", {"iterations": n, "tolerance": 0.0}) for n in (2, 10, 40)
    ]
    settings += [Setting("preview", "presets", PRESETS["preview"]), Setting("every=2", "every", every=2)]
    settings += [
        Setting("few fibres", "n_fibres", {}, {"n_fibres": 3}),
        Setting("pruned", "weight_tolerance", weight_tolerance=1.0),
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study_module, "FIRST_ITERATIONS", 50)
        patch.setattr(study_module, "grid", lambda: settings)
        return out, trade_off(scene, out, compared=range(len(scene.motion.times)))


def test_every_setting_of_the_grid_can_be_made_and_has_a_name_of_its_own(scene):
    settings = grid()
    names = [setting.name for setting in settings]
    assert len(set(names)) == len(names)
    assert [setting.name for setting in settings[:3]] == list(PRESETS)
    for setting in settings:
        replace(scene, solver=setting.solver)  # raises for what is not allowed
        if setting.group != "presets" and "," not in setting.name:
            name, value = setting.name.split("=")
            assert str({**setting.plain(), **setting.solver, **setting.fibres}[name]) == value


def test_more_iterations_come_nearer_to_the_reference_which_has_converged(done):
    _, study = done
    rms = {row.setting.name: row.figures["all"]["rms_mm"] for row in study.rows}
    assert rms["iterations=2"] > rms["iterations=10"] > rms["iterations=40"]
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
    original = Bench.run
    monkeypatch.setattr(
        Bench,
        "run",
        lambda bench, setting, *only: ran.append(setting.name) or original(bench, setting, *only),
    )
    compared = range(len(scene.motion.times))
    settings = [row.setting for row in study.rows[:-1]]
    monkeypatch.setattr(study_module, "grid", lambda: settings)
    again = trade_off(scene, out, compared=compared)
    assert ran == []
    assert [row.figures for row in again.rows] == [row.figures for row in study.rows]
    records = Records(out / "settings", scene, ["spindle"], list(compared))
    against = {doubling.muscle: doubling.iterations for doubling in study.doublings}
    (out / "settings" / f"{records.key(settings[1], against)}.json").unlink()
    trade_off(scene, out, compared=compared)
    assert ran == [settings[1].name]
    assert not list((out / "settings").glob(".*"))


def test_each_muscle_has_iterations_of_its_own_in_the_reference(monkeypatch, tmp_path):
    """One muscle has converged after the first doubling, one after the third, one does not at all."""
    still = {"a": 0, "b": 400, "c": 10_000}
    monkeypatch.setattr(study_module, "FIRST_ITERATIONS", 100)
    monkeypatch.setattr(study_module, "MOST_ITERATIONS", 1600)

    class Fake(Bench):
        def run(self, setting, only=None):
            (name,), n = only, setting.solver["iterations"]
            frame = {
                "time": 0.0, "volume_ratio": 1.0, "edge_stretch_p95": 1.0, "edge_stretch_max": 1.0,
                "dihedral_error_p95": 0.0, "penetration_p95_mm": 0.0, "penetration_max_mm": 0.0,
                "estimated_mm": None,
            }  # fmt: skip
            at = np.full((1, 2, 3), float(min(n, still[name])))
            return Trial({name: MuscleTrial(at, np.empty((1, 0)), [frame], 1.0, 0.0, 0.0)}, None)

    class Nothing:
        trial = staticmethod(lambda *key: None)
        keep_trial = staticmethod(lambda *what: None)

    exact, doublings = study_module._reference(Fake(None, list(still), [0]), Nothing(), lambda words: None)
    assert [d.iterations for d in doublings] == [200, 800, 1600]
    assert [d.converged for d in doublings] == [True, True, False]
    assert [exact.muscles[name].points[0, 0, 0] for name in still] == [0.0, 400.0, 1600.0]


def test_the_key_tells_scenes_frames_settings_and_code_apart(scene, tmp_path, monkeypatch):
    def key(scene=scene, frames=(0, 1), **setting):
        return Records(tmp_path, scene, ["spindle"], frames).key(Setting("any", "any", **setting))

    keys = [key(), key(frames=(0, 2)), key(weight_tolerance=1.0), key(solver={"iterations": 2})]
    keys.append(key(replace(scene, solver={"stiffness": 0.5})))
    keys.append(key(replace(scene, motion=thinned(scene.motion, 2, 2))))
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
    plotted = [f"pareto_{measure.name}" for measure in drawn] + ["estimates"]
    assert names >= {"tradeoff.csv", "estimates.csv"} | {
        f"{name}.{kind}" for name in plotted for kind in FORMATS
    }
    with (out / "tradeoff.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["setting"] for row in rows if row["muscle"] == "all"] == [r.setting.name for r in study.rows]
    assert {row["muscle"] for row in rows} == {"all", "spindle"}
    for row, kept in zip(rows, study.rows, strict=False):
        assert float(row["rms_mm"]) == pytest.approx(kept.figures["all"]["rms_mm"], rel=1e-5)
    text = (out / "tradeoff.rst").read_text()
    assert all(f"- {row.setting.name}\n" in text for row in study.rows)
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
                "dihedral_error_p95": 3.0,
                "penetration_p95_mm": depth,
                "penetration_max_mm": depth,
                "estimated_mm": 0.25,
            }
            for time in (0.0, 1.0)
        ]
        points = np.zeros((2, 4, 3))
        points[1, :, 0] = shift
        return MuscleTrial(points, np.array(lengths), frames, 5.0, 1.0, 2.0)

    exact = Trial({"a": trial(0.0, [[10.0, 20.0]] * 2, None), "b": trial(0.0, [[1.0, 1.0]] * 2, 0.0)}, 1.0)
    other = Trial({"a": trial(3.0, [[16.0]] * 2, None), "b": trial(4.0, [[1.0, 1.0]] * 2, 0.5)}, 2.0)
    figures = measured(other, exact)
    assert figures["all"]["rms_mm"] == pytest.approx(2.5)  # sqrt of the mean of 9/2 and 16/2
    assert figures["all"]["worst_rms_mm"] == pytest.approx(4 / np.sqrt(2))
    assert figures["all"]["max_mm"] == 4.0
    assert figures["all"]["ms_per_frame"] == 10.0
    assert figures["all"]["volume_error_pct"] == pytest.approx(400.0)
    assert figures["all"]["penetration_max_mm"] == 0.5
    assert figures["muscles"]["a"]["penetration_max_mm"] is None
    assert figures["all"]["fibre_length_mm"] == pytest.approx(1.0)
    assert figures["all"]["memory_mb"] == 2.0
    assert [frame["rms_mm"] for frame in figures["muscles"]["a"]["frames"]] == [0.0, 3.0]
    assert {measure.name for measure in MEASURES} <= set(figures["all"])


def test_front_and_means():
    assert front([3.0, 1.0, 2.0, 4.0], [1.0, 5.0, 6.0, 1.0]) == [1, 0]
    assert trimmed_mean([1.0] * 18 + [100.0, 0.0]) == 1.0
    assert trimmed_mean([3.0]) == 3.0


def test_estimates_leave_out_other_models_and_the_pose_at_rest(done):
    study_folder, study = done
    write_tables(study_folder, study)
    pairs = estimates(study.rows, "spindle")
    frames = len(study.rows[0].figures["muscles"]["spindle"]["frames"])
    assert 0 < len(pairs) <= 4 * (frames - 1)
    assert (pairs[:, 0] > 0.005).all()
    ratios = pairs[:, 1] / pairs[:, 0]
    told = estimates_in_words(study)
    assert f"in {np.mean(abs(np.log2(ratios)) <= 1):.0%} of {len(pairs)} frames" in told
    assert told in (study_folder / "tradeoff.rst").read_text()


def test_thinned_motions_end_where_they_did(scene):
    motion = thinned(scene.motion, 2, 3)
    np.testing.assert_array_equal(motion.times, scene.motion.times[[0, 2, 3]])
    for bone, pose in motion.at(motion.times[-1]).items():
        np.testing.assert_array_equal(pose, scene.motion.at(scene.motion.times[3])[bone])


def test_peak_memory_sees_what_was_freed_again():
    with peak_memory() as peak:
        block = np.ones(20_000_000)
        del block
    if peak.megabytes is None:
        pytest.skip("the system does not tell")
    assert 150 < peak.megabytes < 250


def test_settings_are_chosen_by_group_or_name():
    settings = grid()
    assert [s.name for s in chosen(settings, ["presets"])] == list(PRESETS)
    assert {s.group for s in chosen(settings, ["iterations", "weight_tolerance=1"])} == {
        "iterations",
        "weight_tolerance",
    }
    with pytest.raises(ValueError, match=r"no setting is called 'iteratons'; there are groups presets, iter"):
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
    presets = (tmp_path / "out/presets.rst").read_text()
    assert all(f"- {name}\n     - {of}\n" in presets for name in PRESETS for of in ("spindle", "all"))
    assert "- balanced\n     - all\n     - 1\n" in presets
    drawn = {path.name for path in (tmp_path / "out").glob("pareto_*")}
    assert drawn == {f"pareto_{measure.name}.{kind}" for measure in ERRORS for kind in FORMATS}
    refused = CliRunner().invoke(app, [*arguments, "--muscle", "psoas"], catch_exceptions=False)
    assert refused.exit_code == 2
