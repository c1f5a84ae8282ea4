"""The mechanism of all studies: what is varied, what is kept, what fails, and that workers change no bit."""

import signal
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from tiny_scene import write_tiny_scene

from vtkmuscle import InputError, Scene
from vtkmuscle.data.arrays import points_of, triangles_of
from vtkmuscle.io.parts import Parts
from vtkmuscle.studies.case import Case, SceneText
from vtkmuscle.studies.study import outcome_of, study, threads
from vtkmuscle.studies.variation import Variation, samples_of


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    whole = Scene.load(write_tiny_scene(tmp_path_factory.mktemp("scene")))
    spindle = whole.muscles["spindle"]
    return replace(whole, muscles={"spindle": spindle, "other": replace(spindle, solver={"iterations": 2})})


@pytest.fixture(scope="module")
def cases(scene):
    """Of a sample, of other settings, of one that fails, and of a file that is not there."""
    variations = [
        *samples_of("landmarks", 0.5, 1),
        Variation("few", fibres={"n_fibres": 3}),
        Variation("none", fibres={"n_fibres": 0}),
    ]
    found = [
        [Case({"setting": one.name}, name, scene, one, range(3)) for name in scene.muscles]
        for one in variations
    ]
    return [*found, [Case({"setting": "lost"}, "spindle", SceneText("no/scene.toml", {"units": "mm"}))]]


def states(cases, folder, **more):
    found = {}
    study(cases, folder, progress=lambda one: found.update({one.case.name: one.state}), **more)
    return found


@pytest.fixture(scope="module")
def done(cases, tmp_path_factory):
    folder = tmp_path_factory.mktemp("study") / "parts"
    return folder, states(cases, folder)


def test_what_fails_is_said_and_the_others_go_on(done, cases):
    folder, found = done
    of = {name: state for name, state in found.items() if state != "done"}
    assert of == {"none/spindle": "failed", "none/other": "failed", "lost/spindle": "failed"}
    assert "n_fibres" in outcome_of(cases[2][0], folder).failure
    assert outcome_of(cases[3][0], folder).failure
    assert outcome_of(cases[0][0], folder).values["lengths"].shape[0] == 3


def test_workers_change_no_bit(done, cases, tmp_path):
    folder, _ = done
    states(cases, tmp_path, workers=threads(3))
    for case in (case for together in cases[:2] for case in together):
        before, now = (Parts(one).read(case.name) for one in (folder, tmp_path))
        assert before.facts == now.facts
        assert before.arrays.keys() == now.arrays.keys()
        for name, array in before.arrays.items():
            np.testing.assert_array_equal(array, now.arrays[name])


def test_only_what_has_changed_is_done_again(done, cases, scene):
    folder, _ = done
    damaged = folder / "few/other.npz"
    damaged.write_bytes(damaged.read_bytes()[:100])
    assert [name for name, state in states(cases, folder).items() if state == "done"] == ["few/other"]
    more = [[replace(case, variation=replace(case.variation, amount=0.6)) for case in cases[0]], *cases[1:2]]
    again = states(more, folder)
    assert [name for name, state in again.items() if state == "done"] == [case.name for case in more[0]]
    other = replace(scene, muscles={**scene.muscles, "other": replace(scene.muscles["other"], solver={})})
    changed = [[replace(case, scene=other) for case in cases[1]]]
    assert states(changed, folder) == {"few/spindle": "kept", "few/other": "done"}
    assert set(states(cases, folder, fresh=True).values()) == {"done", "failed"}
    assert not list(folder.rglob(".*"))


@pytest.mark.parametrize("count", [1, 3])
def test_one_that_is_stopped_goes_on(cases, tmp_path, count):
    def stop(one):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        study(cases, tmp_path, workers=threads(count), progress=stop)
    finished = {str(path.relative_to(tmp_path).with_suffix("")) for path in tmp_path.rglob("*.npz")}
    assert finished
    found = states(cases, tmp_path)
    assert {name for name, state in found.items() if state == "kept"} == {
        name for name in finished if "none" not in name and "lost" not in name
    }


KILLED = """
import sys
from pathlib import Path
from vtkmuscle import Scene
from vtkmuscle.studies.sensitivity import samples_of
from vtkmuscle.studies.study import Case, study
scene = Scene.load(sys.argv[1])
samples = samples_of("centre", 1.0, 8)
study([[Case({"sample": one.name}, "spindle", scene, one)] for one in samples], Path(sys.argv[2]))
"""


def test_one_that_is_killed_leaves_whole_parts_that_are_kept(tmp_path):
    file, folder = write_tiny_scene(tmp_path / "scene"), tmp_path / "parts"
    command = [sys.executable, "-c", KILLED, str(file), str(folder)]
    process = subprocess.Popen(command)
    while not list(folder.glob("*/*.npz")) and process.poll() is None:
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    left = list(folder.glob("*/*.npz"))
    assert left
    assert all(Parts(folder).read(f"{part.parent.name}/spindle") for part in left)
    scene = Scene.load(file)
    cases = [[Case({"sample": one.name}, "spindle", scene, one)] for one in samples_of("centre", 1.0, 8)]
    assert list(states(cases, folder).values()).count("kept") == len(left)


def test_nothing_is_kept_through_links(cases, tmp_path):
    (tmp_path / "parts").symlink_to(tmp_path)
    with pytest.raises(NotADirectoryError, match="not written through links"):
        study(cases, tmp_path / "parts")


def test_a_variation_of_nothing_is_the_scene(scene):
    assert Variation("any").of(scene) is scene


def test_a_mesh_of_halved_edges_has_four_times_the_triangles(scene):
    surfaces = (one.muscles["spindle"].surface for one in (scene, Variation(halved=True).of(scene)))
    before, after = (len(triangles_of(surface, "spindle")) for surface in surfaces)
    assert after == 4 * before


def test_samples_differ_and_do_not_depend_on_other_muscles(scene):
    first, second = (one.of(scene) for one in samples_of("landmarks", 0.5, 2))
    alone = samples_of("landmarks", 0.5, 1)[0].of(scene.with_muscles("other"))
    place = partial(_place, "other")
    np.testing.assert_array_equal(place(first), place(alone))
    assert np.abs(place(first) - place(second)).max() > 0.01


def _place(name, scene):
    return np.asarray(scene.muscles[name].attachments[0].landmarks)


def test_waves_of_a_seed_are_the_same_again(scene):
    moved = [
        points_of(Variation("1", cause="segmentation", amount=0.2, seed=seed).of(scene).bones["upper"])
        for seed in (0, 0, 1)
    ]
    np.testing.assert_array_equal(moved[0], moved[1])
    assert np.abs(moved[0] - moved[2]).max() > 0.01


def test_a_cause_that_there_is_not_is_refused():
    with pytest.raises(InputError, match="did you mean 'landmarks'"):
        Variation(cause="landmark", amount=1.0)


WITHOUT = """
import importlib, pkgutil, sys
class Hidden:
    def find_spec(self, name, *rest):
        if name.startswith("vtkmuscle.studies"):
            raise ImportError(name)
sys.meta_path.insert(0, Hidden())
import vtkmuscle
for one in pkgutil.walk_packages(vtkmuscle.__path__, "vtkmuscle.", onerror=lambda name: None):
    if not one.name.startswith(("vtkmuscle.studies", "vtkmuscle.__main__", "vtkmuscle.paraview")):
        importlib.import_module(one.name)
vtkmuscle.Scene.from_phantom(vtkmuscle.phantoms.spindle_over_hinge(), n_fibres=3).run(frames="0:1")
"""


def test_the_rest_of_the_package_works_without():
    done = subprocess.run([sys.executable, "-c", WITHOUT], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
