"""The study of speed against accuracy: what it compares, what it writes, and that nothing is run twice."""

import csv
import json
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from tiny_scene import write_tiny_scene
from typer.testing import CliRunner

from vtkmuscle import InputError, Scene
from vtkmuscle.cli import app
from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.data.arrays import Polylines, points_of, polylines_from, surface_from, triangles_of
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.filters.deformer.settings import PRESETS
from vtkmuscle.io.parts import Part, Parts
from vtkmuscle.io.writing import locked
from vtkmuscle.studies.outcome import Outcome
from vtkmuscle.studies.tradeoff import page, trade_off, write_trade_off
from vtkmuscle.studies.tradeoff import study as study_module
from vtkmuscle.studies.tradeoff.measures import (
    ERRORS,
    MEASURES,
    mean_lengths,
    measured,
    together,
    trimmed_mean,
)
from vtkmuscle.studies.tradeoff.page import front
from vtkmuscle.studies.tradeoff.settings import AS_IT_IS, chosen, grid
from vtkmuscle.studies.variation import Variation

SETTINGS = [
    *(Variation(f"iterations={n}", "iterations", {"iterations": n}) for n in (1, 3, 10)),
    Variation("preview", "presets", {"quality": "preview"}),
    Variation("every=2", "every", {}, every=2),
    Variation("few fibres", "n_fibres", {}, {"n_fibres": 3}),
    Variation("pruned", "weight_tolerance", {}, {"weight_tolerance": 1.0}),
]


def outcome(points, lengths=None, **figures):
    """Return what is kept of a muscle with these points, lengths of fibres and figures in each frame."""
    times = [float(i) for i in range(len(points))]
    rows = [{"time": time, "volume_ratio": 1.0, "ms": 5.0} | figures for time in times]
    facts = {"complete": True, "rows": rows, "times": times, "points_at": times, "seconds": {}, "reasons": []}
    kept = {} if lengths is None else {"fibre_lengths": np.array(lengths)}
    return Outcome(facts, {"points": points, **kept})


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return Scene.load(write_tiny_scene(tmp_path_factory.mktemp("scene")))


@pytest.fixture(autouse=True)
def _short_reference(monkeypatch):
    monkeypatch.setattr(study_module, "FIRST_ITERATIONS", 50)


@pytest.fixture(scope="module")
def done(scene, tmp_path_factory):
    out = tmp_path_factory.mktemp("study")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study_module, "FIRST_ITERATIONS", 50)
        patch.setattr(study_module, "grid", lambda: SETTINGS)
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
    settings = [Variation(AS_IT_IS, AS_IT_IS, None), Variation("defaults", "presets", {})]
    monkeypatch.setattr(study_module, "grid", lambda: settings)
    monkeypatch.setattr(study_module, "FIRST_ITERATIONS", 2)
    monkeypatch.setattr(study_module, "MOST_ITERATIONS", 4)
    trade_off(whole, tmp_path, compared=range(3))
    run = whole.run(figures=False)
    for setting in settings:
        for name in whole.muscles:  # a muscle that may meet others meets them
            kept = Outcome.read(Parts(tmp_path / "parts").read(f"{setting.name}/{name}"))
            np.testing.assert_array_equal(mean_lengths(kept), run.fibre_lengths[name].mean(axis=1))
    alone = replace(whole, muscles={"spindle": scene.muscles["spindle"]}).run(figures=False)
    assert np.abs(alone.fibre_lengths["spindle"] - run.fibre_lengths["spindle"]).max() > 0.01


def test_a_setting_that_fails_is_a_row_that_says_why(scene, tmp_path, monkeypatch):
    settings = [Variation("bad", "bad", fibres={"n_fibres": 0}), Variation("defaults", "presets", {})]
    monkeypatch.setattr(study_module, "grid", lambda: settings)
    table = trade_off(scene, tmp_path, compared=[0, 2]).table
    (bad,), (good,) = (table.where(muscle="spindle", setting=name)["message"] for name in ("bad", "defaults"))
    assert "n_fibres" in bad
    assert good == ""
    assert np.isnan(table.where(setting="bad")["rms_mm"]).all()
    assert (table.where(setting="defaults")["rms_mm"] >= 0.0).all()


def test_a_scene_of_paths_is_refused(scene, tmp_path):
    with pytest.raises(ValueError, match="model is 'paths'"):
        trade_off(replace(scene, model="paths", solver={}), tmp_path)


def test_every_setting_of_the_grid_can_be_made_and_has_a_name_of_its_own(scene):
    settings = grid()
    names = [setting.name for setting in settings]
    assert len(set(names)) == len(names)
    assert names[: len(PRESETS)] == list(PRESETS)
    for setting in settings:
        changed = setting.of(scene)  # raises for what is wrong
        if "=" in setting.name:
            name, value = setting.name.split("=")
            muscle = changed.muscles["spindle"]
            given = {"every": setting.every, **muscle.solver, **muscle.fibres}
            assert str(given[name]) == value


def test_more_iterations_come_nearer_to_the_reference_which_has_converged(done):
    _, found = done
    whole = found.table.where(muscle="all")
    rms = dict(zip(whole["setting"].tolist(), whole["rms_mm"], strict=True))
    assert rms["iterations=1"] > rms["iterations=3"] > rms["iterations=10"]
    assert list(rms)[-1] == "reference"
    assert rms["reference"] == 0.0
    (doubling,) = found.doublings
    assert doubling.muscle == "spindle"
    assert doubling.converged
    assert doubling.rms_mm <= study_module.CONVERGED
    assert (whole["max_mm"] >= whole["worst_rms_mm"]).all()
    assert (whole["worst_rms_mm"] >= whole["rms_mm"] * (1 - 1e-12)).all()
    assert (whole["volume_error_pct"] < 1e-6).all()
    assert (whole["ms_per_frame"] > 0).all()


def test_nothing_is_run_twice_and_what_is_lost_is_run_again(done, scene, monkeypatch):
    out, found = done
    settings = [one for one in SETTINGS if one.name != "every=2"]
    monkeypatch.setattr(study_module, "grid", lambda: settings)
    (out / "parts" / settings[1].name / "spindle.npz").unlink()
    said = []
    again = trade_off(scene, out, compared=range(len(scene.motion.times)), announce=said.append).table
    files = {path.stat().st_mtime_ns: path.parent.name for path in (out / "parts").glob("*/*.npz")}
    assert files[max(files)] == settings[1].name
    assert json.loads((out / "study.json").read_text())["complete"] is True
    for name in (one.name for one in settings if one is not settings[1]):
        before, now = (table.where(setting=name) for table in (found.table, again))
        np.testing.assert_array_equal(before["ms_per_frame"], now["ms_per_frame"])  # timed once
    assert not list(out.rglob(".*"))


def test_a_folder_of_something_else_or_in_use_is_refused(done, scene, tmp_path):
    out, _ = done
    with locked(out), pytest.raises(BlockingIOError, match="another run is writing to it"):
        trade_off(scene, out)
    with pytest.raises(InputError, match=r"another study, trade-off of .*scene.toml"):
        trade_off(replace(scene, files={}), out)
    (tmp_path / "tradeoff.csv").write_text("mine")
    with pytest.raises(InputError, match="no study has made"):
        trade_off(scene, tmp_path)


def test_each_muscle_has_iterations_of_its_own_in_the_reference(monkeypatch):
    """One muscle has converged after the first doubling, one after the third, one does not at all."""
    still = {"a": 0, "b": 400, "c": 10_000}
    monkeypatch.setattr(study_module, "FIRST_ITERATIONS", 100)
    monkeypatch.setattr(study_module, "MOST_ITERATIONS", 1600)
    ran = []

    def run(name, iterations):
        ran.append((name, iterations))
        return outcome(np.full((1, 2, 3), float(min(iterations, still[name]))))

    found = [study_module.converged(name, run) for name in still]
    assert [doubling.iterations for _, doubling in found] == [200, 800, 1600]
    assert [doubling.converged for _, doubling in found] == [True, True, False]
    assert [exact.arrays["points"][0, 0, 0] for exact, _ in found] == [0.0, 400.0, 1600.0]
    assert [name for name, _ in ran] == [*"aa", *"bbbb", *"ccccc"]


def test_a_reference_that_fails_is_an_error():
    with pytest.raises(ValueError, match=r"a failed in the reference run.*: torn"):
        study_module.converged("a", lambda *_: Outcome.read(Part({"failure": "torn"})))


def test_table_page_and_plots_have_all_settings_and_can_be_read(done, tmp_path, monkeypatch):
    _, found = done
    # One with a logarithm and one without; the test of the command draws them all.
    drawn = [measure for measure in ERRORS if measure.name in ("rms_mm", "edge_stretch_p95")]
    monkeypatch.setattr(page, "ERRORS", drawn)
    paths = write_trade_off(tmp_path, found)
    plotted = [f"pareto_{measure.name}.{kind}" for measure in drawn for kind in ("png", "svg")]
    assert {path.name for path in paths} == {"tradeoff.csv", "tradeoff.html", *plotted}
    with (tmp_path / "tradeoff.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    names = [*(one.name for one in SETTINGS), "reference"]
    assert [row["setting"] for row in rows if row["muscle"] == "all"] == names
    assert {row["muscle"] for row in rows} == {"all", "spindle"}
    for row, rms in zip(rows, found.table["rms_mm"], strict=True):
        assert float(row["rms_mm"]) == pytest.approx(rms, rel=1e-5)
    text = (tmp_path / "tradeoff.html").read_text()
    assert all(f">{name}</th>" in text for name in names)
    assert text.count("<svg") == len(drawn)
    for path in paths:
        if path.suffix == ".svg":
            assert ElementTree.parse(path).getroot().tag.endswith("svg")
    before = (tmp_path / "pareto_rms_mm.svg").read_bytes()
    write_trade_off(tmp_path, found)
    assert (tmp_path / "pareto_rms_mm.svg").read_bytes() == before


def test_measures_of_a_known_difference():
    def of(shift, lengths, depth):
        depths = {"penetration_p95_mm": depth, "penetration_max_mm": depth}
        rest = {"edge_stretch_p95": 1.1, "edge_stretch_max": 2.0, "dihedral_error_p95_deg": 3.0}
        points = np.zeros((2, 4, 3))
        points[1, :, 0] = shift
        return outcome(points, lengths, volume_ratio=1.0 + shift, **depths, **rest)

    exact = {"a": of(0.0, [[10.0, 20.0]] * 2, None), "b": of(0.0, [[1.0, 1.0]] * 2, 0.0)}
    other = {"a": of(3.0, [[16.0]] * 2, None), "b": of(4.0, [[1.0, 1.0]] * 2, 0.5)}
    muscles = {name: measured(other[name], exact[name]) for name in exact}
    figures = {"all": together(muscles), "muscles": muscles}
    assert figures["all"]["rms_mm"] == pytest.approx(2.5)  # sqrt of the mean of 9/2 and 16/2
    assert figures["all"]["worst_rms_mm"] == pytest.approx(4 / np.sqrt(2))
    assert figures["all"]["max_mm"] == 4.0
    assert figures["all"]["ms_per_frame"] == 10.0
    assert figures["all"]["volume_error_pct"] == pytest.approx(400.0)
    assert figures["all"]["penetration_max_mm"] == 0.5
    assert figures["muscles"]["a"]["penetration_max_mm"] is None
    assert figures["all"]["dihedral_p95_deg"] == 3.0
    assert figures["all"]["fibre_length_mm"] == pytest.approx(1.0)
    failed = measured(Outcome.read(Part({"failure": "torn"})), exact["a"])
    assert set(failed.values()) == {None}
    assert set(together({"a": failed, "b": muscles["b"]}).values()) == {None}
    assert {measure.name for measure in MEASURES} == set(figures["all"])


def test_front_and_means():
    assert front([3.0, 1.0, 2.0, 4.0], [1.0, 5.0, 6.0, 1.0]) == [1, 0]
    assert trimmed_mean([1.0] * 18 + [100.0, 0.0]) == 1.0
    assert trimmed_mean([3.0]) == 3.0


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
    assert (tmp_path / "out/tradeoff.csv").read_text().count("\nall,") == 4
    drawn = {path.name for path in (tmp_path / "out").glob("pareto_*")}
    assert drawn == {f"pareto_{measure.name}.{kind}" for measure in ERRORS for kind in ("png", "svg")}
    refused = CliRunner().invoke(app, [*arguments, "--muscle", "psoas"], catch_exceptions=False)
    assert refused.exit_code == 2
