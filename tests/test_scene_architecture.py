"""The architecture that a run reports: with its tendons and without, and as a table."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from phantoms import block_sheets, fibre_block

from vtkmuscle import Scene
from vtkmuscle.data.anatomy import published
from vtkmuscle.data.arrays import polylines_of
from vtkmuscle.phantoms import spindle_over_hinge


def run(phantom, *, out=None, **hill):
    scene = Scene.from_phantom(phantom, n_fibres=20)
    ((name, muscle),) = scene.muscles.items()
    scene = replace(scene, muscles={name: replace(muscle, hill=hill)})
    return scene.run(out, frames="0:1", figures=False), name


@pytest.fixture(scope="module")
def spindle(tmp_path_factory):
    """A run without a tendon in the scene, and its folder."""
    out = tmp_path_factory.mktemp("spindle")
    return run(spindle_over_hinge(), out=out)[0], out


def test_a_pennate_block_has_the_fascicles_that_are_known():
    phantom = fibre_block("pennate")
    result, name = run(phantom)
    found, known = result.report["muscles"][name]["architecture"], phantom.known
    assert found["fascicle_length_mm"]["mean"] == pytest.approx(known["fibre_length"], rel=0.01)
    for end in ("origin", "insertion"):
        angle = found[f"fascicle_pennation_{end}_deg"]["mean"]
        assert angle == pytest.approx(known["pennation"], abs=1.0)
    area = known["volume"] / known["fibre_length"]
    assert found["pcsa_mm2"] == pytest.approx(area, rel=0.01)
    cosine = np.cos(np.radians(known["pennation"]))
    assert found["pcsa_without_tendon_mm2"] == pytest.approx(area * cosine, rel=0.02)


def test_the_scenes_tendon_shortens_every_fibre_by_itself(spindle):
    (whole, _), (less, name) = spindle, run(spindle_over_hinge(), tendon_slack_length=40.0)
    found = less.report["muscles"][name]["architecture"]
    fibres = polylines_of(whole.rest_fibres(name), name).lengths
    assert found["tendon_from"] == "scene"
    assert found["tendon_length_mm"] == pytest.approx(40.0)
    assert found["fascicle_length_mm"]["mean"] == pytest.approx(fibres.mean() - 40.0, rel=1e-6)
    estimated = whole.report["muscles"][name]["architecture"]
    assert estimated["tendon_from"] == "estimate"
    low, high = estimated["fascicle_length_range_mm"]
    assert low <= estimated["fascicle_length_mm"]["mean"] <= high


def test_a_known_name_gives_the_populations_fascicles_and_a_scene_comes_first():
    scene = Scene.from_phantom(spindle_over_hinge(), n_fibres=20)
    muscle, known = scene.muscles["spindle"], published("semimem_r", "fibre_to_path")
    named = {"Semimembranosus left": muscle, "mine": replace(muscle, muscle="semimem_r")}
    result = replace(scene, muscles=named).run(None, frames="0:1")
    for name in named:
        found = result[name].architecture
        whole = found["fascicle_length_mm"]["mean"] + found["tendon_length_mm"]
        assert found["tendon_from"] == "population"
        assert found["fascicle_length_mm"]["mean"] == pytest.approx(known.low * whole, rel=1e-6)
        low, high = found["fascicle_length_range_mm"]
        assert low < known.low * whole <= known.high * whole < high
        assert found["fascicle_length_by_thickness_mm"] > 3.0 * found["fascicle_length_mm"]["mean"]
        least, most = found["pcsa_without_tendon_range_mm2"]
        assert least < found["pcsa_without_tendon_mm2"] < most
    told = replace(scene, muscles={"semimem_r": replace(muscle, hill={"tendon_slack_length": 40.0})})
    assert told.run(None, frames="0:1")["semimem_r"].architecture["tendon_from"] == "scene"


@pytest.mark.filterwarnings("ignore:.*landmarks are 30 mm from their bone")  # a tendon within the muscle
@pytest.mark.parametrize("kind", ["pennate", "bipennate"])
def test_between_aponeuroses_fascicles_are_the_fibres_and_nothing_is_left_to_estimate(kind):
    phantom = fibre_block(kind)
    scene = Scene.from_phantom(phantom, n_fibres=30)
    muscle = scene.muscles["block"]
    scene = replace(scene, muscles={"block": replace(muscle, aponeuroses=block_sheets(kind), hill={})})
    result = scene.run(None, frames="0:1", figures=False)
    found, known = result.report["muscles"]["block"]["architecture"], phantom.known
    assert found["tendon_from"] == "aponeuroses"
    assert found["tendon_length_mm"] == 0.0
    assert found["fascicle_length_mm"]["mean"] == pytest.approx(known["fibre_length"], rel=0.01)
    for end in ("origin", "insertion"):
        angle = found[f"fascicle_pennation_{end}_deg"]["mean"]
        assert angle == pytest.approx(known["pennation"], abs=1.0)
    area = known["volume"] / known["fibre_length"] * np.cos(np.radians(known["pennation"]))
    assert found["pcsa_without_tendon_mm2"] == pytest.approx(area, rel=0.02)


def test_fascicles_are_normalised_by_the_length_of_their_sarcomeres():
    result, name = run(spindle_over_hinge(), sarcomere_length=3.0)
    found = result.report["muscles"][name]["architecture"]
    length = found["fascicle_length_mm"]["mean"]
    assert found["fascicle_length_normalised_mm"] == pytest.approx(0.9 * length)
    assert found["volume_without_tendon_mm3"] == pytest.approx(
        (1.0 - found["tendon_volume_share"]) * found["muscle_volume_mm3"]
    )


def test_architecture_is_a_table(spindle):
    result, out = spindle
    (row,) = csv.DictReader((out / "architecture.csv").read_text().splitlines())
    found = result.report["muscles"]["spindle"]["architecture"]
    assert row["muscle"] == "spindle"
    assert row["tendon_from"] == "estimate"
    assert float(row["volume_mm3"]) == pytest.approx(found["muscle_volume_mm3"])
    assert float(row["fascicle_length_mm"]) == pytest.approx(found["fascicle_length_mm"]["mean"])
