"""Muscles whose fibres go from aponeurosis to aponeurosis: in a file, in Python, and in motion."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
import tomli_w
from phantoms import block_sheets, fibre_block

from vtkmuscle import Scene
from vtkmuscle.data.arrays import cell_array, points_of, polylines_of
from vtkmuscle.data.attachments import Aponeurosis
from vtkmuscle.filters import FibreSource
from vtkmuscle.phantoms import spindle_over_hinge
from vtkmuscle.run import muscle_pipeline
from vtkmuscle.scene import SceneError

WIDTH, LENGTH = 20.0, 120.0


def scene_of(kind):
    """Return a block between plates that shift, with its aponeuroses, and how wide its halves are."""
    scene = Scene.from_phantom(fibre_block(kind), n_fibres=40)
    muscle = replace(scene.muscles["block"], aponeuroses=block_sheets(kind))
    return replace(scene, muscles={"block": muscle}), WIDTH if kind == "pennate" else WIDTH / 2


@pytest.mark.parametrize("kind", ["pennate", "bipennate"])
def test_oblique_fibres_between_plates_that_shift_have_their_known_lengths(kind):
    scene, width = scene_of(kind)
    pipeline = muscle_pipeline(scene, "block")
    for time in (0.0, 10.0):
        fibres = pipeline.metrics.update(time=time).output
        known = np.hypot(width, LENGTH / 2 - time)
        assert cell_array(fibres, "Length", "fibres").mean() == pytest.approx(known, rel=0.01)
        ways = np.diff(polylines_of(fibres, "fibres").points.reshape(40, -1, 3)[:, [0, -1]], axis=1)[:, 0]
        angles = [np.degrees(np.arctan2(np.abs(ways[:, 0]), np.abs(ways[:, 2])))]
        angles += [cell_array(fibres, f"Pennation{end}", "fibres") for end in ("Origin", "Insertion")]
        assert np.mean(angles, axis=1) == pytest.approx(np.degrees(np.arcsin(width / known)), abs=1.0)


def test_what_is_pulled_along_goes_from_bone_to_bone():
    scene, _ = scene_of("bipennate")
    pipeline = muscle_pipeline(scene, "block")
    assert isinstance(pipeline.fibres, FibreSource)
    assert pipeline.deformer.fibres is pipeline.rest_paths
    assert pipeline.rest_paths is not pipeline.fibres
    plain = muscle_pipeline(
        replace(scene, muscles={"block": replace(scene.muscles["block"], aponeuroses=())}), "block"
    )
    assert plain.rest_paths is plain.fibres
    assert np.array_equal(
        points_of(plain.rest_paths.update().output), points_of(pipeline.rest_paths.update().output)
    )


@pytest.fixture
def saved(tmp_path):
    return scene_of("bipennate")[0].save(tmp_path)


def test_a_scene_keeps_its_aponeuroses_and_mirrors_them(saved):
    tables = tomllib.loads(saved.read_text())
    assert {side: len(files) for side, files in tables["muscles"]["block"]["aponeuroses"].items()} == {
        "proximal": 2,
        "distal": 1,
    }
    before, after = scene_of("bipennate")[0], Scene.load(saved)
    for one, two in zip(*(scene.muscles["block"].aponeuroses for scene in (before, after)), strict=True):
        assert one.side == two.side
        assert np.allclose(one.points, two.points)
    saved.write_text(tomli_w.dumps(tables | {"mirror": "x"}))
    mirrored = Scene.load(saved).muscles["block"].aponeuroses
    assert np.allclose(mirrored[0].points, before.muscles["block"].aponeuroses[0].points * [-1, 1, 1])


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda muscle, scene: muscle["aponeuroses"].pop("distal"), "muscles.block.aponeuroses.distal"),
        (
            lambda muscle, scene: muscle["aponeuroses"].update(distal="none.vtp"),
            "muscles.block.aponeuroses.distal",
        ),
        (lambda muscle, scene: muscle.pop("fibres"), "the muscle has aponeuroses, but no fibres"),
        (lambda muscle, scene: scene.update(deformer="none"), "aponeuroses need a deformed muscle"),
    ],
)
def test_what_is_wrong_in_the_file_is_named(saved, change, says):
    tables = tomllib.loads(saved.read_text())
    change(tables["muscles"]["block"], tables)
    saved.write_text(tomli_w.dumps(tables))
    with pytest.raises(SceneError, match=says):
        Scene.load(saved)


def test_a_run_has_lengths_of_paths_beside_those_of_fibres():
    scene = Scene.from_phantom(spindle_over_hinge(), n_fibres=12)
    z, half = np.linspace(-20.0, 40.0, 7), 6.0
    sheets = []
    for side, y in (("proximal", -16.0), ("distal", -48.0)):
        left, right = (np.column_stack([np.full(7, x), np.full(7, y), z]) for x in (-half, half))
        sheets.append(Aponeurosis(side, np.vstack([left, right[::-1]])))
    muscle = replace(scene.muscles["spindle"], aponeuroses=tuple(sheets))
    result = replace(scene, muscles={"spindle": muscle}).run(frames="0:2")
    assert result.lengths["spindle"].mean() == pytest.approx(140.0, rel=0.02)
    across = result.fibre_lengths["spindle"]
    assert 20.0 < across.min() < across.max() < 45.0
