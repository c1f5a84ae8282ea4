"""The errors that a run states: which causes, how large, and where they are written."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from vtkmuscle import Scene, run_with_errors
from vtkmuscle.accuracy import KINDS, SOLVED
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.estimate import convergence_error
from vtkmuscle.phantoms import spindle_over_hinge


@pytest.fixture(scope="module")
def scene():
    whole = Scene.from_phantom(spindle_over_hinge(), n_fibres=8, resolution=8)
    return replace(whole, motion=whole.motion.part(range(0, len(whole.motion.times), 5)))


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return tmp_path_factory.mktemp("errors")


@pytest.fixture(scope="module")
def result(scene, out):
    return run_with_errors(scene, out, figures=False, errors=KINDS, landmark_error=2.0, landmark_samples=3)


@pytest.fixture(scope="module")
def plain(scene):
    return scene.run(figures=False)


def test_every_run_states_what_takes_no_further_solve(plain):
    errors = plain.report["muscles"]["spindle"]["errors"]
    of_rest = {"volume", "pcsa", "pcsa_without_tendon", "fascicle_length"}
    assert errors.keys() == {"length", "fibre_length", "moment_arm_distal_angle", *of_rest}
    assert errors["fascicle_length"]["parts"].keys() == {"segments", "fibres", "tendon", "aponeuroses"}
    assert errors["fibre_length"]["parts"].keys() == {"segments", "fibres"}
    assert errors["length"]["parts"].keys() == {"segments", "fibres"}
    assert errors["volume"]["parts"].keys() == {"facets", "solve"}
    assert errors["moment_arm_distal_angle"]["parts"].keys() == {"segments", "fibres", "slopes"}
    assert plain.report["muscles"]["spindle"]["errors_not_known"] == dict.fromkeys(KINDS, "not asked for")


def test_what_is_asked_for_is_added_and_the_results_stay(result, plain):
    np.testing.assert_array_equal(result.lengths["spindle"], plain.lengths["spindle"])
    errors = result.report["muscles"]["spindle"]["errors"]
    of_fibres, of_paths = (errors[name]["parts"] for name in ("fibre_length", "length"))
    assert of_fibres.keys() == {"fibres", *KINDS}  # finer slices tell of segments too
    assert of_paths.keys() == {"segments", "fibres", *KINDS}
    assert all(part > 0.0 for parts in (of_fibres, of_paths) for part in parts.values())
    assert errors["moment_arm_distal_angle"]["parts"].keys() == {*of_paths, "slopes"}
    assert result.report["muscles"]["spindle"]["errors_not_known"] == {}


def test_every_quantity_of_the_report_adds_up(result):
    for quantity in result.report["muscles"]["spindle"]["errors"].values():
        assert quantity.keys() == {"value", "unit", "parts", "total"}
        assert quantity["total"] == pytest.approx(np.sqrt(sum(p**2 for p in quantity["parts"].values())))
    assert all(
        key in result.report["definitions"]
        for one in result.errors["spindle"].values()
        for key in (f"errors.{cause}" for cause in one.parts)
    )


def test_the_model_is_what_the_paths_alone_differ_by(scene, result):
    paths = replace(scene, model="paths").run(figures=False)
    mine, theirs = (one.fibre_lengths["spindle"].mean(axis=1) for one in (result, paths))
    found = result.errors["spindle"]["fibre_length"].parts["model"]
    np.testing.assert_allclose(found, 2.0 / np.sqrt(3.0) * np.abs(mine - theirs))
    off = mine - result.lengths["spindle"].mean(axis=1)
    found = result.errors["spindle"]["length"].parts["model"]
    np.testing.assert_allclose(found, 2.0 / np.sqrt(3.0) * np.abs(off))
    slopes = np.gradient(off, np.radians(result.times), edge_order=2)
    found = result.errors["spindle"]["moment_arm_distal_angle"].parts["model"]
    np.testing.assert_allclose(found, 2.0 / np.sqrt(3.0) * np.abs(slopes))


def test_finer_fibres_are_solved_again_fibre_by_fibre(scene, result):
    muscle = scene.muscles["spindle"]
    finer = replace(muscle, fibres={**muscle.fibres, "resolution": 16, "slice_tolerance": 0.0})
    other = replace(scene, muscles={"spindle": finer}).run(figures=False)
    for quantity, mine, theirs in (
        ("each_length", result.lengths, other.lengths),
        ("each_fibre_length", result.fibre_lengths, other.fibre_lengths),
    ):
        np.testing.assert_allclose(
            result.errors["spindle"][quantity].parts["slices"],
            convergence_error(mine["spindle"], theirs["spindle"], order=2.0),
        )


def test_tables_have_the_errors(result, out):
    for file, quantity in (("lengths.csv", "each_length"), ("fibre_lengths.csv", "each_fibre_length")):
        rows = list(csv.DictReader((out / file).read_text().splitlines()))
        found = np.array([float(row["length_err_mm"]) for row in rows]).reshape(8, -1).T
        np.testing.assert_array_equal(found, result.errors["spindle"][quantity].total)
    rows = list(csv.DictReader((out / "moment_arms_summary.csv").read_text().splitlines()))
    found = [float(row["mean_err_mm"]) for row in rows]
    np.testing.assert_allclose(found, result.errors["spindle"]["moment_arm_distal_angle"].total)
    table = result.moment_arms().table().where(fibre=3)["moment_arm_err_mm"]
    total = result.errors["spindle"]["each_moment_arm_distal_angle"].total
    np.testing.assert_allclose(table, total[:, 3])
    written = json.loads((out / "report.json").read_text())["muscles"]["spindle"]["errors"]
    assert written["length"]["total"] == result.errors["spindle"]["length"].report()["total"]


def test_a_solve_that_fails_is_said_and_the_run_goes_on(scene, monkeypatch):
    def failing(*_):
        raise InputError("", "the mesh is too fine")

    monkeypatch.setattr("vtkmuscle.studies.variation.halved", failing)
    result = run_with_errors(scene, figures=False, errors=["mesh"])
    told = result.report["muscles"]["spindle"]
    assert told["errors_not_known"]["mesh"] == "the mesh is too fine"
    assert "mesh" not in told["errors"]["length"]["parts"]


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"errors": ["mash"]}, "mesh"),
        ({"errors": ["landmarks"], "landmark_samples": 2}, "3 or more"),
        ({"landmark_error": 0.0}, "positive"),
    ],
)
def test_what_says_nothing_is_refused(scene, asked, words):
    with pytest.raises(ValueError, match=words):
        run_with_errors(scene, figures=False, **asked)


def test_all_is_all_but_the_landmarks():
    assert {*KINDS} - {*SOLVED} == {"landmarks"}
