"""Nothing is executed that the user did not ask for: the working folder may be from elsewhere."""

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest
from tiny_scene import write_tiny_scene

#: What the package imports, directly or not, and names of the standard library that it uses.
PLANTED = """
    numpy scipy numba llvmlite vtk vtkmodules pyvista matplotlib typer rich
    pydantic pydantic_core tomli_w lazy_loader
    click shellingham PIL yaml pooch kiwisolver cycler scooby csv json logging tomllib xml hashlib
    tempfile subprocess uuid colorsys sitecustomize usercustomize h5py meshio trimesh IPython cmocean
    colorcet
""".split()  # noqa: SIM905 -- a list of this length is easier to read as words
#: Runs each command, and ends with an error where one ended with an unexpected status.
ALL_COMMANDS = """
import sys
from vtkmuscle.cli import main
commands = {
    "--help": (0,),
    "run scene.toml --out out --frames 0:1": (0,),
    "export out/spindle.pvd all.vtkhdf": (0, 2),  # 2 where VTK cannot
    "demo --out demo --frames 0:1 --no-figures": (0,),
    "paraview-path --folder links": (0,),
}
for command, statuses in commands.items() if __name__ == "__main__" else ():
    sys.argv = ["vtkmuscle", *command.split()]
    try:
        main()
    except SystemExit as end:
        if (end.code or 0) not in statuses:
            raise
"""
PROGRAM = Path(sysconfig.get_path("scripts")) / "vtkmuscle"


@pytest.fixture
def planted(tmp_path):
    """Return a scene folder in which modules lie that note that they were imported."""
    folder = write_tiny_scene(tmp_path / "from_mail").parent
    for name in PLANTED:
        (folder / name).mkdir()
        trap = f"open({str(tmp_path / 'caught')!r}, 'a').write({name + ' '!r})\n"
        (folder / name / "__init__.py").write_text(trap + f"raise ImportError({name!r})\n")
    return folder


def caught(planted):
    marks = planted.parent / "caught"
    return marks.read_text().split() if marks.exists() else []


def run_in(folder, *arguments, program=(str(PROGRAM),), **environment):
    ours = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}
    return subprocess.run(
        [*program, *arguments],
        cwd=folder,
        env={**ours, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_traps_work(planted):
    run_in(planted, "-c", "import numpy", program=(sys.executable,))
    assert caught(planted) == ["numpy"]


@pytest.mark.skipif(not PROGRAM.exists(), reason="the program is not installed")
def test_the_program_imports_nothing_from_the_working_folder(planted):
    done = run_in(planted, "info", "muscles/spindle.vtp")
    assert (done.returncode, caught(planted)) == (0, []), done.stderr


def test_no_command_imports_from_the_working_folder(planted, tmp_path):
    """All of them in one process, begun as the program is: its own folder first on the path."""
    (tmp_path / "program.py").write_text(ALL_COMMANDS)
    done = run_in(planted, program=(sys.executable, str(tmp_path / "program.py")))
    assert caught(planted) == []
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr


def test_python_m_imports_no_dependency_from_the_working_folder(planted):
    for name in ("csv", "json", "logging", "tomllib", "xml", "hashlib", "tempfile", "subprocess", "uuid"):
        shutil.rmtree(planted / name)  # what Python itself loads before the program begins
    for name in ("colorsys", "sitecustomize", "usercustomize"):
        shutil.rmtree(planted / name)
    program = (sys.executable, "-m", "vtkmuscle")
    # An empty part of the search path is the working folder once more.
    arguments = ("run", "scene.toml", "--out", "out", "--frames", "0:1", "--no-figures")
    done = run_in(planted, *arguments, program=program, PYTHONPATH=os.pathsep)
    assert caught(planted) == []
    assert done.returncode == 0, done.stderr


def test_a_configuration_of_numba_in_the_working_folder_has_no_say(planted, tmp_path):
    shutil.rmtree(planted / "yaml")
    (tmp_path / "installed").mkdir()
    reader = "def safe_load(file):\n    return {'cache_dir': 'elsewhere'}\n"
    (tmp_path / "installed/yaml.py").write_text(reader)
    (planted / ".numba_config.yaml").write_text("cache_dir: elsewhere\n")
    code = (
        "from vtkmuscle.isolation import leave_out_working_folder\n"
        "leave_out_working_folder()\nimport numba\nprint([numba.config.CACHE_DIR])"
    )
    done = run_in(
        planted,
        "-P",
        "-c",
        code,
        program=(sys.executable,),
        PYTHONPATH=str(tmp_path / "installed"),
        NUMBA_CACHE_DIR="",
    )
    assert done.stdout.strip() == "['']", done.stderr
