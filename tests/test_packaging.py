"""The package's metadata agree: what it needs, what it is called, who wrote it."""

import re
import tomllib
from pathlib import Path

import pytest

import vtkmuscle

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
#: Packages that conda-forge calls otherwise.
CONDA_NAMES = {"matplotlib": "matplotlib-base"}


@pytest.fixture(scope="module")
def recipe():
    path = ROOT / "recipe" / "recipe.yaml"
    if not path.is_file():
        pytest.skip("the recipe is not here")
    return path.read_text(encoding="utf-8")


def test_the_recipe_asks_for_what_the_package_asks_for(recipe):
    run = recipe[recipe.index("  run:") : recipe.index("tests:")]
    asked = dict(re.findall(r"^    - ([\w-]+) >=(.+)$", run, flags=re.MULTILINE))
    needed = dict(one.split(">=") for one in PROJECT["dependencies"])
    assert asked.pop("python") == "${{ python_min }}"
    assert asked == {CONDA_NAMES.get(name, name): version for name, version in needed.items()}


def test_the_recipe_is_of_this_version(recipe):
    assert re.search(r'^  version: "?([\d.]+)"?$', recipe, flags=re.MULTILINE)[1] == vtkmuscle.__version__
    python = re.search(r'^  python_min: "([\d.]+)"$', recipe, flags=re.MULTILINE)[1]
    assert PROJECT["requires-python"] == f">={python}"
    for name, target in PROJECT["scripts"].items():
        assert f"- {name} = {target}\n" in recipe


def test_types_are_for_others_too():
    assert (Path(vtkmuscle.__file__).parent / "py.typed").is_file()


def test_the_supported_versions_are_those_of_the_documentation():
    page = (ROOT / "docs" / "start" / "install.rst").read_text(encoding="utf-8")
    numpy = next(one for one in PROJECT["dependencies"] if one.startswith("numpy"))
    assert f"Python {PROJECT['requires-python'].removeprefix('>=')} or later" in page
    assert f"NumPy {numpy.split('>=')[1]} or later" in page
