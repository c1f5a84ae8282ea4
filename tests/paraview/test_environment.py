"""What `vtkmuscle paraview-path` makes and prints."""

import json
import os
import subprocess
import sys

import pytest
from commands import python, refused, vtkmuscle_

from vtkmuscle.paraview.environment import COMPATIBILITY, PLUGINS, link_packages


def test_the_folder_gives_what_the_filters_need_and_no_vtk(tmp_path):
    link_packages(tmp_path)
    script = (
        "import vtkmuscle.core.mesh.harmonic, vtkmuscle.core.pbd.solver, llvmlite, pydantic, tomli_w\n"
        "from importlib.util import find_spec\n"
        "print(find_spec('vtk'), find_spec('vtkmodules'))"
    )
    done = python("-S", "-c", script, env={"PYTHONPATH": str(tmp_path)})
    assert done.stdout.split() == ["None", "None"]


def test_the_commands_set_the_variables(tmp_path):
    folder = tmp_path / "it's here"
    done = vtkmuscle_("paraview-path", "--folder", folder)
    script = done.output + 'printf "%s\\n" "$PV_PLUGIN_PATH" "$PYTHONPATH"'
    printed = subprocess.run(
        ["sh", "-c", script], env={"PYTHONPATH": "/before"}, capture_output=True, text=True, check=True
    )
    assert printed.stdout.splitlines() == [str(PLUGINS), f"{COMPATIBILITY}:{folder}:/before"]
    assert [path.name for path in PLUGINS.glob("*.py")] == ["vtkmuscle_plugin.py"]


def test_links_are_made_anew(tmp_path):
    link_packages(tmp_path)
    gone = str(tmp_path / "gone")  # as of an environment that has been moved since
    (tmp_path / "numpy").unlink()
    (tmp_path / "numpy").symlink_to(gone)
    record = tmp_path / ".made_by_vtkmuscle.json"
    record.write_text(json.dumps(json.loads(record.read_text()) | {"numpy": gone, "old": gone}))
    (tmp_path / "old").symlink_to(gone)
    link_packages(tmp_path)
    assert not (tmp_path / "old").is_symlink()
    assert (tmp_path / "numpy" / "__init__.py").is_file()


def test_a_folder_with_something_else_in_it_is_left_alone(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    assert "mine.txt is not a link" in refused("paraview-path", "--folder", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_links_of_the_user_are_left_alone_all_of_them(tmp_path):
    for name in ("a", "numpy", "z"):
        (tmp_path / name).symlink_to("/somewhere")
    assert "a is a link of another program" in refused("paraview-path", "--folder", tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "numpy", "z"]
    assert all(os.readlink(path) == "/somewhere" for path in tmp_path.iterdir())


def test_an_empty_name_is_no_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    vtkmuscle_("paraview-path", "--folder", "", status=2)
    assert not list(tmp_path.iterdir())


def test_without_a_cache_a_folder_must_be_given(monkeypatch):
    monkeypatch.setenv("VTKMUSCLE_CACHE", "")
    assert "--folder" in refused("paraview-path")


@pytest.mark.parametrize("twice", [1, 2])
def test_the_default_folder_is_in_the_cache(monkeypatch, tmp_path, twice):
    monkeypatch.setenv("VTKMUSCLE_CACHE", str(tmp_path))
    for _ in range(twice):
        vtkmuscle_("paraview-path")
    (folder,) = tmp_path.iterdir()
    assert folder.name.startswith(f"paraview-py3.{sys.version_info.minor}-")
