"""Results on a plotter, and films of them."""

import copy
import sys

import numpy as np
import pytest
import pyvista
from PIL import Image
from tiny_scene import write_tiny_scene
from typer.testing import CliRunner

from vtkmuscle import InputError, Scene, phantoms
from vtkmuscle.cli import app
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.data.arrays import points_of, triangles_of
from vtkmuscle.plotting import MovingScene, ScenePose, can_render
from vtkmuscle.run.display import ResultDisplay
from vtkmuscle.scene.faults import SceneError

pytestmark = pytest.mark.skipif(can_render() is not None, reason=str(can_render()))


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return Scene.load(write_tiny_scene(tmp_path_factory.mktemp("tiny"))).run()


def drawn(picture):
    """Return the part of a picture that is not white."""
    return float((np.asarray(picture)[..., :3] < 250).any(axis=-1).mean())


def test_a_pose_is_drawn_where_the_result_has_it(result):
    shown = ResultDisplay(result, off_screen=True, size=(200, 160))
    for position in (0, 4, 2):
        shown.show(position)
        frame = result.frames[position]
        for name in ("upper", "lower"):
            rest, moved = (points_of(one[name]) for one in (result.rest_bones(), result.bones(frame=frame)))
            matrix = pyvista.array_from_vtkmatrix(shown.scene._bones[name].GetUserMatrix())
            np.testing.assert_allclose(apply_transform(matrix, rest), moved, atol=1e-9)
        mesh, lines = (
            actors["spindle"].mapper.input for actors in (shown.scene._muscles, shown.scene._fibres)
        )
        np.testing.assert_allclose(
            points_of(mesh), points_of(result.muscle("spindle", frame=frame)), atol=1e-5
        )
        np.testing.assert_allclose(
            points_of(lines), points_of(result.fibres("spindle", frame=frame)), atol=1e-5
        )
    shown.scene.plotter.close()


def sliders(plotter):
    """Return the sliders of a plotter, where its PyVista keeps them."""
    return getattr(plotter, "widgets", plotter).slider_widgets


def test_normals_follow_the_muscle(result):
    shown = ResultDisplay(result, off_screen=True, size=(200, 160))
    shown.show(4)
    mesh = shown.scene._muscles["spindle"].mapper.input
    mesh_alone = pyvista.PolyData.from_regular_faces(points_of(mesh), triangles_of(mesh, "spindle"))
    turned = mesh_alone.compute_normals(cell_normals=False, split_vertices=False)["Normals"]
    assert (np.asarray(mesh.point_data.normals) * turned).sum(axis=1).min() > 0.95
    shown.scene.plotter.close()


def test_a_muscle_without_a_frame_is_hidden():
    phantom = phantoms.spindle_over_hinge()
    scene = MovingScene({}, phantom.muscles, {}, off_screen=True, size=(200, 160))
    before = drawn(scene.plotter.screenshot(return_img=True))
    scene.show(ScenePose())
    scene.plotter.render()
    assert before > 0.02
    assert drawn(scene.plotter.screenshot(return_img=True)) == 0.0
    scene.plotter.close()


def test_plot_gives_a_plotter_of_a_frame_or_with_a_slider(result):
    plotter = result.plot(time=result.times[3], show=False, off_screen=True)
    assert drawn(plotter.screenshot(return_img=True)) > 0.02
    assert not sliders(plotter)
    plotter.close()
    plotter = result.plot(show=False, off_screen=True)
    (slider,) = sliders(plotter)
    assert slider.GetRepresentation().GetMaximumValue() == result.times[-1]
    plotter.close()
    with pytest.raises(InputError, match="spindle"):
        result.plot(muscles=["spindel"], show=False)


def test_a_film_has_a_picture_of_every_frame(result, tmp_path):
    pictures = []
    with Image.open(result.movie(tmp_path / "film.gif", size=(160, 120), fps=10)) as film:
        assert film.n_frames == len(result.frames)
        assert film.size == (160, 120)
        assert film.info["duration"] == 100
        for number in range(film.n_frames):
            film.seek(number)
            pictures.append(np.asarray(film.convert("RGB"), dtype=int))
    assert np.abs(pictures[0] - pictures[-1]).max() > 50


def test_an_mp4_is_written_where_there_is_ffmpeg(result, tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="the extra 'movie' is not installed")
    film = result.movie(tmp_path / "film.mp4", size=(160, 120))
    count, seconds = ffmpeg.count_frames_and_secs(str(film))
    assert count == len(result.frames)
    assert seconds == pytest.approx(len(result.frames) / 15.0, abs=0.05)
    assert [path.name for path in tmp_path.iterdir()] == ["film.mp4"]


def test_without_ffmpeg_it_is_said_what_to_install(result, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(ImportError, match=r"'\.\[movie\]'"):
        result.movie(tmp_path / "film.mp4")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "changes", "words"),
    [
        ("film.avi", {}, r"\.gif, \.mp4"),
        ("film.gif", {"fps": 0}, "fps is 0"),
        ("film.gif", {"size": (161, 120)}, "even"),
        ("film.gif", {"muscles": ["none"]}, "no muscle 'none'"),
    ],
)
def test_what_no_film_can_be_is_refused(name, changes, words, result, tmp_path):
    with pytest.raises(InputError, match=words):
        result.movie(tmp_path / name, **changes)


def test_figures_are_drawn_again_in_one_call(result, tmp_path):
    written = result.write_figures(tmp_path / "figures")
    assert {path.name for path in written} >= {"rest_pose.png", "spindle_lengths.png"}
    assert all(path.stat().st_size > 1000 for path in written)


def test_a_mesh_shows_itself_with_its_fibres_and_bones():
    phantom = phantoms.spindle_over_hinge()
    mesh = pyvista.wrap(phantom.muscles["spindle"])
    fibres = mesh.muscle.fibres(attachments=phantom.attachments["spindle"], n_fibres=8)
    seen = []
    for shown, options in ((mesh, {}), (mesh, {"fibres": fibres, "bones": phantom.bones}), (fibres, {})):
        plotter = shown.muscle.plot(show=False, off_screen=True, **options)
        seen.append(drawn(plotter.screenshot(return_img=True)))
        plotter.close()
    assert min(seen) > 0.001
    assert seen[1] > seen[0]


def test_a_result_and_a_scene_print_in_a_line_or_two(result):
    scene = Scene.from_phantom(phantoms.hip(), n_fibres=4)
    assert str(scene) == (
        "Scene('hip': gluteus_medius, gluteus_maximus, iliacus; bones pelvis, femur; 46 frames; mm)"
    )
    many = copy.copy(result)
    many.muscle_names = [f"muscle_{i}" for i in range(30)]
    many.verdicts = {f"muscle_{i}": "look" if i % 3 else "ok" for i in range(30)}
    assert repr(many) == "Result('tiny': 5 frames of 30 muscles (10 ok, 20 look))"


def test_some_muscles_of_a_scene_are_run_alone(tmp_path, monkeypatch):
    scene = Scene.from_phantom(phantoms.hip(), n_fibres=4)
    kept = scene.with_muscles("iliacus", "gluteus_medius")
    assert list(kept.muscles) == ["gluteus_medius", "iliacus"]
    assert kept.bones == scene.bones
    for names, words in (((), "no muscle is named"), (("iliac",), "did you mean")):
        with pytest.raises(SceneError, match=words):
            scene.with_muscles(*names)
    path = write_tiny_scene(tmp_path)
    monkeypatch.chdir(tmp_path)
    options = ["--muscle", "spindle", "--frames", "0:2", "--no-figures", "--no-report"]
    answer = CliRunner().invoke(app, ["run", str(path), *options])
    assert answer.exit_code == 0, answer.output
    assert (tmp_path / "tiny_spindle_out/report.json").is_file()
    assert CliRunner().invoke(app, ["run", str(path), "--muscle", "none"]).exit_code != 0
