"""What importing the package brings in, seen in child processes; its layers are import-linter's."""

import json
import pkgutil

import pytest
from commands import python

import vtkmuscle
import vtkmuscle.core
import vtkmuscle.filters
import vtkmuscle.io
import vtkmuscle.opensim
import vtkmuscle.plotting

HEAVY = {"vtk", "vtkmodules", "pyvista", "numba", "scipy", "matplotlib", "typer", "rich", "pydantic"}
REPORT = """
import importlib, json, sys
for name in {names!r}:
    importlib.import_module(name)
print(json.dumps(sorted(sys.modules)))
"""


def modules_after_importing(*names):
    """Return the names of all modules in a child process that imported some."""
    return json.loads(python("-c", REPORT.format(names=list(names))).stdout)


def packages(modules):
    return {name.partition(".")[0] for name in modules}


def modules_in(package):
    return [package.__name__] + [
        module.name for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    ]


def test_importing_vtkmuscle_adds_a_handful_of_light_modules():
    # A count of modules is what an import costs, and unlike a time is the same on every machine.
    added = set(modules_after_importing("vtkmuscle")) - set(modules_after_importing("importlib"))
    assert len(added) < 20, sorted(added)
    assert not packages(added) & HEAVY


def test_the_core_imports_no_vtk():
    loaded = packages(modules_after_importing(*modules_in(vtkmuscle.core)))
    assert loaded.isdisjoint({"vtk", "vtkmodules", "pyvista"})


def test_a_run_imports_only_what_it_needs():
    # scipy.stats alone takes as long as numba, half a second; a run's figures import matplotlib where drawn.
    loaded = modules_after_importing("vtkmuscle.scenes")
    assert {"scipy.stats", "scipy.integrate", "matplotlib"}.isdisjoint(loaded)
    assert {"vtkmuscle.phantoms", "vtkmuscle.opensim"}.isdisjoint(loaded)


def test_drawing_imports_no_pyvista():
    parts = ("drawing", "figures", "sheets", "studio")
    loaded = modules_after_importing(*(f"vtkmuscle.plotting.{part}" for part in parts))
    assert "pyvista" not in packages(loaded)


@pytest.mark.parametrize("package", [vtkmuscle, vtkmuscle.io, vtkmuscle.opensim, vtkmuscle.plotting])
def test_public_names_exist_and_all_are_listed(package):
    assert package.__all__
    assert all(getattr(package, name) is not None for name in package.__all__)


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no_such_name"):
        vtkmuscle.no_such_name  # noqa: B018
