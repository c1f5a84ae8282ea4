"""The plugin in ParaView itself, where pvpython is installed: the same points as in plain Python."""

import json
import os
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
import scene_on_disk
from numpy.testing import assert_allclose

from vtkmuscle.paraview.environment import link_packages, settings
from vtkmuscle.phantoms import spindle_over_hinge

HERE = Path(__file__).parent

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """The environment that `vtkmuscle paraview-path` says to set; a reason to skip where it cannot be."""
    if shutil.which("pvpython") is None:
        pytest.skip("pvpython is not installed")
    shown = ["pvpython", "-c", "import sys; print('%d.%d' % sys.version_info[:2])"]
    theirs = subprocess.run(shown, capture_output=True, text=True, check=True).stdout.split()[-1]
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    if theirs != python:
        pytest.skip(f"pvpython has Python {theirs}, but numba here is for Python {python}")
    folder = tmp_path_factory.mktemp("packages")
    link_packages(folder)
    variables = {name: os.pathsep.join(map(str, paths)) for name, paths in settings(folder).items()}
    # pvpython runs scripts that import others beside them.
    ours = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}
    return {**ours, **variables}


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scene")
    scene_on_disk.write(folder, spindle_over_hinge())
    return folder


def run(environment, *command, cwd=None):
    done = subprocess.run(
        [str(word) for word in command],
        env=environment,
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done


def test_the_pipeline_gives_the_points_that_plain_python_gives(environment, scene, tmp_path):
    run(environment, "pvpython", HERE / "paraview_pipeline.py", scene, tmp_path / "points.json")
    there = json.loads((tmp_path / "points.json").read_text(encoding="utf-8"))
    chain = scene_on_disk.pipeline_in_python(scene)
    assert there.pop("time steps") == chain["moving"].motion.times.tolist()
    here = scene_on_disk.results(chain)
    assert list(there) == list(here)
    for name, points in here.items():
        assert_allclose(np.array(there[name]), np.array(points), rtol=0.0, atol=1e-9, err_msg=name)
    moved = np.array(here["deformed at 7"]) - np.array(here["fixed at 7"])
    assert np.abs(moved).max() > 1.0


def test_proxies_have_the_declared_properties_abort_and_say_what_is_wrong(environment, scene):
    done = run(environment, "pvpython", HERE / "paraview_properties.py", scene)
    assert "FibreTubes: radius is -3.0, but must be a finite number > 0" in done.stderr


def test_a_surface_of_quads_is_read(environment, tmp_path):
    file = tmp_path / "quad.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n", encoding="utf-8")
    code = f"from vtkmuscle.io import read_surface; print(read_surface({str(file)!r}).GetNumberOfPolys())"
    assert run(environment, "pvpython", "-c", code).stdout.split()[-1] == "2"


def pixels_of(picture):
    from matplotlib.image import imread

    return imread(picture)[..., :3]


@pytest.fixture(scope="module")
def display():
    """What stands before a command that renders: Debian's ParaView does so on an X display only."""
    if "DISPLAY" in os.environ:
        return []
    if shutil.which("xvfb-run"):
        # Without -noreset the server starts anew when its last client goes, deaf to one that comes just then.
        return ["xvfb-run", "-a", "-s", "-screen 0 1280x1024x24 -noreset"]
    return pytest.skip("this ParaView renders on an X display only, and there is neither one nor xvfb-run")


def test_the_documented_script_runs(environment, display, scene, tmp_path):
    text = (HERE.parents[1] / "docs/how_to/paraview.rst").read_text(encoding="utf-8")
    _, _, after = text.partition("   from paraview.simple import *\n")
    block, _, _ = after.partition("\n\n``pvpython`` connects")
    assert "SaveScreenshot" in block
    script = tmp_path / "documented.py"
    script.write_text("from paraview.simple import *\n" + textwrap.dedent(block), encoding="utf-8")
    run(environment, *display, "pvbatch", script, cwd=scene / "scene")
    picture = pixels_of(scene / "scene/muscle.png")
    assert 0.02 < (np.abs(picture - picture[0, 0]).max(axis=-1) > 0.1).mean() < 0.9
