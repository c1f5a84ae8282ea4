"""Speed against accuracy: times, errors to the limit and to published curves, and the cheapest setting."""

from dataclasses import replace

import numpy as np
import pytest
from commands import refused, vtkmuscle_
from tiny_scene import write_tiny_scene

import vtkmuscle
from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.io.literature import LiteratureCurve
from vtkmuscle.tradeoffs import ALL, ERRORS


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A scene with its own moment arm, 3 mm higher, as the published curve; coarse and fine paths."""
    folder = tmp_path_factory.mktemp("tradeoff")
    scene = vtkmuscle.Scene.from_phantom(vtkmuscle.phantoms.spindle_over_hinge(), n_fibres=8)
    ((name, muscle),) = scene.muscles.items()
    ((coordinate, joint),) = scene.run(frames="0:3").moment_arms()[name].items()
    curve = LiteratureCurve("own", name, coordinate, "", joint.values, joint.mean + 3.0)
    scene = replace(scene, muscles={name: replace(muscle, literature=(curve,))}, files={})
    settings = {"deformer": ["none"], "quality": ["preview", "accurate"], "n_fibres": [8]}
    return scene, folder / "out", vtkmuscle.tradeoff(scene, folder / "out", frames="0:3", **settings)


def test_finer_paths_come_nearer_to_the_limit(measured):
    whole = measured[2].table.where(muscle=ALL)
    coarse, fine = whole["moment_arm_rms_mm"]
    assert 0.0 < fine < 0.5 * coarse < 1.0
    assert (whole["ms"] > 0.0).all()
    assert set(ERRORS) <= set(whole)


def test_a_value_that_is_not_allowed_is_refused_before_anything_runs(measured):
    with pytest.raises(ValueError, match="n_fibres: 0 is not allowed"):
        vtkmuscle.tradeoff(measured[0], n_fibres=[8, 0])


def test_deformers_alone_are_compared(measured):
    found = vtkmuscle.tradeoff(
        measured[0], frames="0:2", deformer=["none", "paths"], paths=[{"resolution": 8}]
    )
    assert found.cheapest(within=100.0)["paths"] == {"resolution": 8}
    assert found.table.where(muscle=ALL)["deformer"].tolist() == ["none", "paths"]


def test_a_run_that_fails_as_a_whole_is_a_row_whatever_is_in_its_folder(measured, tmp_path):
    scene = measured[0].with_settings(deformer="pbd", prediction="velocity", solved_triangles=0)
    tried = {"frames": "0:1", "external_force": [[0.0, 0.0, 0.0], [1e308, 0.0, 0.0]]}
    whole = vtkmuscle.tradeoff(scene, tmp_path, **tried).table.where(muscle=ALL)
    assert whole["external_force"].tolist() == tried["external_force"]
    found = [whole.where(external_force=force)["verdict"].item() for force in tried["external_force"]]
    assert found == ["ok", "failed"]
    other = vtkmuscle.tradeoff(replace(scene, name="other", files={}), tmp_path, **tried)
    assert other.table["verdict"].tolist() == ["failed", "failed"]


def test_published_curves_of_the_scene_are_compared(measured):
    np.testing.assert_allclose(measured[2].table.where(muscle=ALL)["published_rms_mm"], 3.0, atol=0.2)


def test_errors_are_in_millimetres_and_curves_in_degrees_whatever_the_units_of_coordinates(measured):
    """An angle in radians, and a translation, whose arms have no unit."""
    motion = measured[0].motion
    ((name, angle),) = motion.coordinates.items()
    sliding = {"distal": np.tile([0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (len(motion.times), 1))}
    other = {"frame": Coordinate(0.0 * motion.times, "mm", twists=sliding)}
    other[name] = replace(angle, values=np.radians(angle.values), unit="rad")
    scene = replace(measured[0], motion=replace(motion, coordinates=other))
    poses = scene.run(frames="0:1", deformer="none").pose_table()
    assert [*poses] == ["frame", "time", "coordinate frame", name], "a coordinate was no column"
    table = vtkmuscle.tradeoff(scene, frames="0:3", deformer="none", quality="preview", n_fibres=8).table
    np.testing.assert_allclose(table["published_rms_mm"], 3.0, atol=0.2)
    known = measured[2].table.where(quality="preview")["moment_arm_rms_mm"]
    np.testing.assert_allclose(table["moment_arm_rms_mm"], known, rtol=1e-4)


def test_the_cheapest_setting_within_an_error_is_named_and_none_is_an_error(measured):
    found = measured[2]
    best = found.cheapest(within=100.0)
    whole = found.table.where(muscle=ALL)
    assert best["ms"] == np.nanmin(whole["ms"])
    assert found.cheapest(within=whole["moment_arm_rms_mm"][1])["quality"] == "accurate"
    with pytest.raises(ValueError, match="no setting has an error of 1e-12 mm or less; the least is"):
        found.cheapest(within=1e-12)


def test_finished_runs_are_read_again_and_table_and_figure_are_written(measured):
    scene, out, found = measured
    settings = {"deformer": ["none"], "quality": ["preview", "accurate"], "n_fibres": [8]}
    again = vtkmuscle.tradeoff(scene, out, frames="0:3", **settings)
    first = found.table.where(muscle=ALL, n_fibres=8)
    np.testing.assert_array_equal(again.table.where(muscle=ALL)["ms"], first["ms"])
    assert (out / "tradeoff.csv").read_text().startswith("deformer,quality,n_fibres,muscle,verdict,ms,")
    assert (out / "tradeoff.png").stat().st_size > 5000
    ((name, muscle),), (curve, *_) = scene.muscles.items(), scene.muscles["spindle"].literature
    muscle = replace(muscle, literature=(replace(curve, arms=curve.arms + 3.0),))
    other = vtkmuscle.tradeoff(replace(scene, muscles={name: muscle}), out, frames="0:3", **settings)
    np.testing.assert_allclose(other.table["published_rms_mm"], 6.0, atol=0.2)  # not of the old curve
    (out / "tradeoff.png").write_text("mine")
    with pytest.raises(ValueError, match=r"tradeoff\.png: the file exists"):
        vtkmuscle.tradeoff(scene, out, frames="0:3", progress=pytest.fail, **settings)


def test_a_setting_has_its_colour_in_all_panels(measured):
    """Also a setting without an error in a panel takes a colour, and the legend explains each."""
    table = measured[2].table
    rows = [list(row) for row in zip(*table.values(), strict=True)]
    rows[0][list(table).index("length_rms_mm")] = None
    figure = replace(measured[2], table=vtkmuscle.Table(tuple(table), rows)).figure()
    colours = [{line.get_label(): line.get_color() for line in axes.lines} for axes in figure.axes]
    assert len(colours) > 1
    assert colours == colours[:1] * len(colours)
    assert [text.get_text() for text in figure.legends[0].texts] == list(colours[0])


def test_a_certain_mistake_of_the_scene_is_an_error(tmp_path):
    scene = write_tiny_scene(tmp_path)
    scene.write_text(scene.read_text().replace('units = "mm"', 'units = "m"'))
    with pytest.raises(ValueError, match="litres"):
        vtkmuscle.tradeoff(scene, frames="0:1", quality="preview")


def test_the_command_prints_the_table_and_the_cheapest_setting(tmp_path):
    scene = write_tiny_scene(tmp_path)
    settings = ["--vary", "deformer=none", "--vary", "quality=preview,balanced", "--frames", "0:2"]
    done = vtkmuscle_("tradeoff", scene, "--out", tmp_path / "out", *settings, "--within", "5")
    assert "moment arm" in done.output
    assert "deformer = none, quality = " in done.output
    call = "tradeoff", scene, "--out", tmp_path / "bad", "--vary"
    assert "--vary: 'fibres' is no pair" in refused(*call, "fibres")
    assert "'frames' is no setting of a scene" in refused(*call, "frames=1,2")
    assert "--vary: 'n_fibres' is given twice" in refused(*call, "n_fibres=8", "--vary", "n_fibres=8")
