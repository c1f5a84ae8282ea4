"""Compiled kernels are kept for as long as nothing that they are made from changes."""

import importlib
import os
import pickle
import subprocess
import sys
import warnings

import numba
import pytest

from vtkmuscle.core import jit
from vtkmuscle.core.jit import kernel

posix = pytest.mark.skipif(os.name != "posix", reason="modes say who can write to a file on POSIX alone")

CONSTANT = "LENGTH = 2.0\n"
MIDDLE = """
from vtkmuscle.core.jit import lane
from toy.constants import (
    LENGTH,
)

@lane
def longer(x):
    return LENGTH * x
"""
KERNEL = """
from vtkmuscle.core.jit import kernel
from toy import middle

longer = middle.longer

@kernel
def length(x):
    return longer(x)
"""


@pytest.fixture
def kernels(tmp_path):
    """Return the folder of kernels of this test, empty."""
    # Numba reads its variables again when it compiles and one of them has changed.
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("NUMBA_CACHE_DIR", "")
        patch.setenv("VTKMUSCLE_CACHE", str(tmp_path / "cache"))
        patch.setattr(jit, "_unusable", set())
        numba.config.reload_config()
        yield tmp_path / "cache" / "kernels"
    numba.config.reload_config()


@pytest.fixture
def toy(tmp_path):
    """Return a folder with a package of a kernel, what it calls, and a constant of that."""
    folder = tmp_path / "here" / "toy"
    folder.mkdir(parents=True)
    for name, text in (("__init__", ""), ("constants", CONSTANT), ("middle", MIDDLE), ("kernels", KERNEL)):
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    return folder


@pytest.fixture
def loaded(monkeypatch):
    """Return what loads the kernel of a toy package anew."""

    def load(folder, *arguments):
        for name in [name for name in sys.modules if name.partition(".")[0] == "toy"]:
            del sys.modules[name]
        with monkeypatch.context() as patch:
            patch.syspath_prepend(str(folder.parent))
            patch.setattr(sys, "dont_write_bytecode", True)
            length = importlib.import_module("toy.kernels").length
        if arguments:
            length(*arguments)
        return length

    yield load
    for name in [name for name in sys.modules if name.partition(".")[0] == "toy"]:
        del sys.modules[name]


def hits(kernel):
    return sum(kernel.stats.cache_hits.values())


def test_what_was_compiled_is_found_again(kernels, toy, loaded):
    first, again = loaded(toy), loaded(toy)
    assert first is not again
    assert (first(3.0), again(3.0)) == (6.0, 6.0)
    assert (hits(first), hits(again)) == (0, 1)
    assert sorted(path.name.partition("-")[0] for path in kernels.glob("*/*")) == ["length", "longer"]


def test_a_constant_of_a_file_behind_another_takes_effect(kernels, toy, loaded):
    assert loaded(toy)(3.0) == 6.0
    # As long as before, and within the same tick of a coarse clock: only the content tells.
    (toy / "constants.py").write_text(CONSTANT.replace("2", "5"), encoding="utf-8")
    assert loaded(toy)(3.0) == 15.0
    (toy / "constants.py").write_text(CONSTANT, encoding="utf-8")
    old = loaded(toy)
    assert old(3.0) == 6.0
    assert hits(old) == 1


def test_without_a_cache_nothing_is_kept(kernels, toy, loaded, monkeypatch):
    monkeypatch.setenv("VTKMUSCLE_CACHE", "")
    assert loaded(toy)(3.0) == 6.0
    assert not kernels.parent.exists()
    assert not list(toy.rglob("*.kernel"))


def test_a_folder_that_cannot_be_written_to_is_told_of_once(kernels, toy, loaded, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("no folder", encoding="utf-8")
    monkeypatch.setenv("VTKMUSCLE_CACHE", str(tmp_path / "file"))
    kernel = loaded(toy)
    with pytest.warns(UserWarning, match=r"cannot be kept in .*file.*set VTKMUSCLE_CACHE"):
        assert kernel(3.0) == 6.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert kernel(3) == 6.0


def test_the_versions_used_last_are_kept(kernels, toy, loaded, monkeypatch):
    def age_of(path):
        return path.stat().st_mtime

    monkeypatch.setattr(jit, "VERSIONS", 2)
    for number in range(4):
        (toy / "constants.py").write_text(f"LENGTH = {number}.0\n", encoding="utf-8")
        assert loaded(toy)(1.0) == number
        for age, folder in enumerate(sorted(kernels.glob("toy.kernels-*"), key=age_of)):
            os.utime(folder, (age, age))
    assert len(list(kernels.glob("toy.kernels-*"))) == 2
    assert hits(loaded(toy)) == 0
    kept = loaded(toy)
    assert kept(1.0) == 3.0
    assert hits(kept) == 1


@pytest.mark.slow
def test_processes_that_compile_at_once_find_what_each_made(kernels, toy, loaded):
    code = "import sys\nfrom toy.kernels import length\nsys.stdin.readline()\nlength({})"
    started = [
        subprocess.Popen(
            [sys.executable, "-W", "error", "-c", code.format(value)],
            env={**os.environ, "PYTHONPATH": str(toy.parent), "NUMBA_CACHE_DIR": ""},
            stdin=subprocess.PIPE,
        )
        for value in ("3.0", "3", "True")
    ]
    for process in started:
        process.stdin.write(b"\n")
        process.stdin.flush()
    assert [process.wait(120) for process in started] == [0, 0, 0]
    for process in started:
        process.stdin.close()
    kernel = loaded(toy)
    assert (kernel(3.0), kernel(3), kernel(True)) == (6.0, 6.0, 2.0)
    assert hits(kernel) == 3


@pytest.mark.parametrize("length", [0, -1])
def test_a_damaged_file_is_compiled_anew_and_found_whole_again(kernels, toy, loaded, length):
    loaded(toy, 3.0)
    (file,) = kernels.rglob("length-*.kernel")
    file.write_bytes(file.read_bytes()[:length])
    mended, again = loaded(toy), loaded(toy)
    assert (mended(3.0), again(3.0)) == (6.0, 6.0)
    assert (hits(mended), hits(again)) == (0, 1)
    assert pickle.loads(file.read_bytes())  # a part is refused; the length counts the kernels of the process


def test_a_kernel_within_a_function_is_compiled_for_what_it_is_made_from(kernels):
    def times(factor):
        @kernel
        def product(x):
            return factor * x

        return product

    assert (times(2.0)(3.0), times(5.0)(3.0)) == (6.0, 15.0)
    assert not kernels.exists()


def test_a_kernel_is_compiled_alike_whichever_calls_it_first():
    """Its machine code is kept for all callers: their options must not decide its last digits."""
    inner = jit.kernel(lambda a, b, c: a * b + c)
    outer = jit.vector_kernel(lambda a, b, c: inner(a, b, c) * a + b)
    outer(1.0, 2.0, 3.0)
    (signature,) = inner.signatures
    assert "contract" in outer.inspect_llvm(outer.signatures[0])
    assert "contract" not in inner.inspect_llvm(signature)


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system knows no affinity")
def test_those_that_a_process_is_kept_from_do_not_count():
    code = (
        "import os; os.sched_setaffinity(0, [min(os.sched_getaffinity(0))]); "
        "from vtkmuscle.core.machine import processors; print(processors())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert done.stdout.split() == [b"1"]
