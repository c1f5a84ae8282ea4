"""Fixtures for all tests."""

import gc
import os
import signal
from pathlib import Path

# Each processor has a process of tests; threads of BLAS beside it would only wait for one another.
# This is read when NumPy is imported, here and in child processes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pytest
from hypothesis import settings
from tried import Tried

# A shell's background job ignores Ctrl-C, and so would the programs that tests start and interrupt.
signal.signal(signal.SIGINT, signal.default_int_handler)

# How long an example takes is the machine's, not the code's.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

REPOSITORY = Path(__file__).resolve().parents[1]
#: What the first and the second process begin with: at the end, one would wait for the other, or share it.
FIRST = "test_two_joint_moment_arms.py", "test_readme.py"


@pytest.fixture(scope="session", autouse=True)
def _cache_of_its_own(tmp_path_factory):
    """Keep what tests leave out of the user's cache, but for what they compile: nothing is compiled twice."""
    import numba

    from vtkmuscle.core.jit import kernel_folder

    with pytest.MonkeyPatch.context() as patch:
        if (kernels := kernel_folder()) is not None:
            patch.setenv("NUMBA_CACHE_DIR", str(kernels))  # of child processes
            patch.setattr(numba.config, "CACHE_DIR", str(kernels))
        patch.setenv("VTKMUSCLE_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture
def rng():
    """Random numbers, the same in every run."""
    return np.random.default_rng(20210615)


@pytest.fixture
def noted(monkeypatch):
    """Return what notes each call of a function of a module or class, by its arguments, in a list."""

    def noted(owner, name, note, notes=None):
        notes, original = [] if notes is None else notes, getattr(owner, name)

        def noting(*arguments, **keywords):
            notes.append(note(*arguments) if callable(note) else note)
            return original(*arguments, **keywords)

        monkeypatch.setattr(owner, name, noting)
        return notes

    return noted


@pytest.fixture
def renders():
    """A test that draws is skipped where nothing can be drawn."""
    from vtkmuscle.plotting import can_render

    if (reason := can_render()) is not None:
        pytest.skip(reason)


def data_folder(name, file, what):
    """Return a fixture of a folder of real data, by a file in it; a test is skipped without the folder."""

    @pytest.fixture(scope="session")
    def folder():
        root = Path(os.environ.get("VTKMUSCLE_DATA", REPOSITORY.parent / "shared" / "data"))
        if not (root / name / file).is_file():
            pytest.skip(f"{what} not at {root / name}; set VTKMUSCLE_DATA to the folder it is in")
        return root / name

    return folder


#: The folders' licences are in their READMEs.
lhdl_hip = data_folder("lhdl_hip", "scene.toml", "the real hip data set is")
dti_gastrocnemius = data_folder("dti_gastrocnemius", "tracts.vtp", "the muscle with measured fibres is")
opensim_data = data_folder("opensim", "arm26.osim", "OpenSim's models are")
bp3d_knee = data_folder("bp3d_knee", "scene.toml", "the second subject is")
bp3d_arm = data_folder("bp3d_arm", "shoulder_abduction.toml", "the arm is")
label_data = data_folder("labels", "totalsegmentator_pelvis_3mm.nii.gz", "the map of labels is")


def new_phantom(name):
    """Return a fixture of a new phantom (made once per process, copied for each test)."""

    @pytest.fixture
    def phantom():
        from vtkmuscle import phantoms

        return getattr(phantoms, name)()

    return phantom


spindle, cylinder = new_phantom("spindle_over_hinge"), new_phantom("wrapping_cylinder")
block, hip = new_phantom("pennate_block"), new_phantom("hip")


@pytest.fixture
def scene_file(tmp_path):
    """The file of a new tiny scene."""
    from tiny_scene import write_tiny_scene

    return write_tiny_scene(tmp_path / "scene")


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """The tiny scene."""
    from tiny_scene import write_tiny_scene

    from vtkmuscle import Scene

    return Scene.load(write_tiny_scene(tmp_path_factory.mktemp("scene")))


#: Names in a test that takes a package of the extra ``test-all``.
OPTIONAL = {"igl", "importorskip"}

#: Marks of tests that are left out, and what brings them in.
LEFT_OUT = {"slow": "--all", "long": "--long", "study": "-m study"}

TRIED = pytest.StashKey[Tried]()


def pytest_configure(config):
    """Begin to count what is tried."""
    config.stash[TRIED] = Tried(long=config.getoption("long"))


@pytest.fixture(scope="session")
def tried(request):
    """Where cases of damaged input, signals and full disks are counted."""
    return request.config.stash[TRIED]


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config):
    """Write tables from one process, which has counted all."""
    if config.getoption("tried_table") or config.getoption("extremes_table"):
        config.option.numprocesses = 0


def pytest_sessionfinish(session, exitstatus):
    """Write what was tried, where that is asked for and nothing failed."""
    path = session.config.getoption("tried_table")
    if path is not None and exitstatus == 0:
        session.config.stash[TRIED].write(Path(path))


def pytest_addoption(parser):
    """Add the options of the extremes."""
    parser.addoption("--all", action="store_true", help="run slow tests, and those of optional programs")
    parser.addoption("--long", action="store_true", help="run the extremes in their long form, and all tests")
    parser.addoption("--tried-table", metavar="FILE", help="write what was tried to this .rst")
    parser.addoption("--extremes-table", metavar="FILE", help="write what became of extremes to this .rst")


def pytest_collection_modifyitems(config, items):
    """Leave out what is asked for by --all, --long or -m study, unless it is; begin with FIRST."""
    first, second = ([item for item in items if item.path.name == name] for name in FIRST)
    rest = [item for item in items if item.path.name not in FIRST]
    half = max(0, len(items) // 2 - len(first))  # each is given half of all, and then what the other left
    items[:] = [*first, *rest[:half], *second, *rest[half:]]
    option = config.option
    slow = option.all or option.long or option.extremes_table or option.tried_table
    asked = {"slow": slow, "long": option.long, "study": "study" in option.markexpr}
    for item in items:
        for mark, how in LEFT_OUT.items():
            if item.get_closest_marker(mark) and not asked[mark]:
                item.add_marker(pytest.mark.skip(reason=f"run it with {how}"))
        if not OPTIONAL.isdisjoint(item.function.__code__.co_names):
            item.add_marker("optional")


def pytest_collection_finish():
    """Leave what is there by now, thousands of tests and all modules, out of searches for garbage."""
    gc.collect()
    gc.freeze()
