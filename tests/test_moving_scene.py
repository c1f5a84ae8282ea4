"""Results on a plotter, and films of them."""

import numpy as np
import pytest
import pyvista
from PIL import Image
from tiny_scene import write_tiny_scene

from vtkmuscle import InputError, Scene, phantoms
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.data.arrays import points_of
from vtkmuscle.plotting import can_render
from vtkmuscle.plotting.plotters import MovingScene
from vtkmuscle.run.figures import ResultDisplay

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


def test_a_muscle_without_a_frame_is_hidden():
    phantom = phantoms.spindle_over_hinge()
    scene = MovingScene({}, phantom.muscles, {}, off_screen=True, size=(200, 160))
    before = drawn(scene.plotter.screenshot(return_img=True))
    scene.show({}, {}, {})
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


@pytest.mark.parametrize(
    ("name", "changes", "words"),
    [
        ("film.avi", {}, r"is a \.gif"),
        ("film.gif", {"fps": 0}, "fps is 0"),
        ("film.gif", {"size": (0, 120)}, "size is"),
        ("film.gif", {"muscles": ["none"]}, "no muscle 'none'"),
    ],
)
def test_what_no_film_can_be_is_refused(name, changes, words, result, tmp_path):
    with pytest.raises(InputError, match=words):
        result.movie(tmp_path / name, **changes)


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
