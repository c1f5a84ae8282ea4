"""The measurement of speed against accuracy: what it compares, and that its measures are right."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tiny_scene import write_tiny_scene

from vtkmuscle import Scene
from vtkmuscle.data.arrays import surface_from
from vtkmuscle.pipelines import QUALITIES

FOLDER = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def tradeoff():
    """Import the script."""
    if not FOLDER.is_dir():
        pytest.skip("the benchmarks are not here")
    sys.path.insert(0, str(FOLDER))
    try:
        import tradeoff as script
    finally:
        sys.path.remove(str(FOLDER))
    return script


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return Scene.load(write_tiny_scene(tmp_path_factory.mktemp("scene")))


def test_more_iterations_come_nearer_to_the_reference_and_a_failure_is_a_row(tradeoff, scene, tmp_path):
    settings = [
        *(tradeoff.Setting(f"iterations={n}", "iterations", {"iterations": n}) for n in (1, 10)),
        tradeoff.Setting("scene", "scene"),
        tradeoff.Setting("bad", "bad", fibres={"n_fibres": 0}),
    ]
    table = tradeoff.trade_off(scene, tmp_path, settings, range(3))
    whole = table.where(muscle="all")
    assert whole["setting"].tolist() == ["iterations=1", "iterations=10", "scene", "bad", "reference"]
    one, ten, _, bad, reference = whole["rms_mm"]
    assert one > ten > reference == 0.0
    assert np.isnan(bad)
    assert "n_fibres" in whole["message"][3]
    assert (whole["volume_error_pct"][:3] < 1e-6).all()
    assert (whole["ms_per_frame"][:3] > 0).all()
    kept = (tmp_path / "scene/report.json").stat().st_mtime_ns
    again = tradeoff.trade_off(scene, tmp_path, settings[:1], range(3))
    assert (tmp_path / "scene/report.json").stat().st_mtime_ns == kept
    assert again.where(muscle="all")["ms_per_frame"][0] == whole["ms_per_frame"][0]  # timed once


def test_every_setting_of_the_grid_can_be_made_and_has_a_name_of_its_own(tradeoff, scene):
    settings = tradeoff.grid()
    names = [setting.name for setting in settings]
    assert len(set(names)) == len(names)
    assert names[: len(QUALITIES)] == list(QUALITIES)
    for setting in settings:
        changed = setting.of(scene)  # raises for what is wrong
        if "=" in setting.name:
            name, value = setting.name.split("=")
            given = {**changed.solver_of("spindle"), **changed.muscles["spindle"].fibres}
            given |= {f"paths.{key}": one for key, one in (changed.paths or {}).items()}
            assert str(given[name]) == value


def test_settings_take_the_place_of_those_that_trade_speed_and_no_others(tradeoff, scene):
    solver, paths = {"iterations": 7, "bone_clearance": 0.5}, {"resolution": 20, "levers": False}
    own = replace(scene, solver=solver, paths=paths, quality="preview")
    changed = tradeoff.Setting("a", "a", {"iterations": 9}, paths={"resolution": 8}).of(own)
    assert changed.solver == {"bone_clearance": 0.5, "iterations": 9}
    assert changed.paths == {"levers": False, "resolution": 8}
    assert changed.quality is None


def result(shift, lengths, depth):
    """Return what stands for a result: a muscle of one triangle in two frames, the second moved."""
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    depths = {"penetration_p95_mm": depth, "penetration_max_mm": depth}
    rest = {"edge_stretch_p95": 1.1, "edge_stretch_max": 2.0, "dihedral_error_p95_deg": 3.0}
    rows = [{"time": float(i), "volume_ratio": 1.0 + shift, "ms": 5.0} | depths | rest for i in (0, 1)]
    return SimpleNamespace(
        units="mm",
        frames=[0, 1],
        times=[0.0, 1.0],
        finished=lambda _: 2,
        report={"muscles": {"a": {"frames": rows, "seconds": {}}}},
        fibre_lengths={"a": np.array(lengths)},
        muscle=lambda _, time: surface_from(
            points + np.array([shift * time, 0.0, 0.0]), np.array([[0, 1, 2]])
        ),
    )


def test_measures_of_a_known_difference(tradeoff):
    times = [0.0, 1.0]
    one = tradeoff.measured(
        result(3.0, [[16.0]] * 2, None), result(0.0, [[10.0, 20.0]] * 2, None), "a", times
    )
    other = tradeoff.measured(result(4.0, [[1.0]] * 2, 0.5), result(0.0, [[1.0]] * 2, 0.0), "a", times)
    both = tradeoff.together({"one": one, "other": other})
    assert both["rms_mm"] == pytest.approx(2.5)  # sqrt of the mean of 9/2 and 16/2
    assert both["worst_rms_mm"] == pytest.approx(4 / np.sqrt(2))
    assert both["max_mm"] == pytest.approx(4.0)
    assert both["ms_per_frame"] == 10.0
    assert both["volume_error_pct"] == pytest.approx(400.0)
    assert both["penetration_max_mm"] == 0.5
    assert one["penetration_max_mm"] is None
    assert both["fibre_length_mm"] == pytest.approx(1.0)
    failed = tradeoff.measured(None, result(0.0, [[1.0]] * 2, 0.0), "a", times)
    assert set(failed.values()) == {None}
    assert set(tradeoff.together({"one": one, "other": failed}).values()) == {None}
    assert tradeoff.trimmed_mean([1.0] * 18 + [100.0, 0.0]) == 1.0
    assert tradeoff.trimmed_mean([3.0]) == 3.0


def test_settings_are_chosen_by_group_or_name(tradeoff):
    settings = tradeoff.grid()
    assert [s.name for s in tradeoff.chosen(settings, ["presets"])] == ["preview", "balanced", "accurate"]
    found = tradeoff.chosen(settings, ["iterations", "weight_tolerance=1"])
    assert {s.group for s in found} == {"iterations", "weight_tolerance"}
    with pytest.raises(ValueError, match="no setting is called iteratons; there are groups presets, publ"):
        tradeoff.chosen(settings, ["iteratons"])
