"""A strap over two joints, run by its paths, for tests of exports."""

import pytest
from two_joint_scene import save_strap, scene_with

from vtkmuscle import Scene


@pytest.fixture(scope="session")
def ran(tmp_path_factory):
    """The file of the scene, and its result, also in the folder ``results`` beside the file."""
    folder = tmp_path_factory.mktemp("strap")
    save_strap(folder, n_fibres=10)
    grid = {"grid": {"upper": [-10, 30, 20], "lower": [0, 40, 10]}}
    path = scene_with(
        folder, tmp_path_factory.mktemp("joints"), motion=grid, deformer="none", name="left strap"
    )
    return path, Scene.load(path).run(path.parent / "results", figures=False)
