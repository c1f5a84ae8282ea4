"""A second process compiles what a run needs, and is gone with the first one."""

import importlib
import json
import os
import subprocess
import sys

import numba
import pytest
from numba import float64, int64, types

from vtkmuscle.core import compile_ahead
from vtkmuscle.core.compile_ahead import LIST, spelled, type_of
from vtkmuscle.core.fibres.vertex_groups import VertexGroups

SMALL = "vtkmuscle.core.mesh.surface", "mean_point", [spelled(float64[:, ::1])]
#: What the second process runs, with a list of its own.
WORK = """
import pathlib, sys
from vtkmuscle.core import compile_ahead
compile_ahead.LIST = pathlib.Path(sys.argv[1])
compile_ahead._work()
"""


def begun(folder, rows):
    """Return a second process for some rows of a list."""
    (folder / "list.json").write_text(json.dumps(rows), encoding="utf-8")
    return subprocess.Popen(
        [sys.executable, "-c", WORK, str(folder / "list.json")],
        env={**os.environ, "VTKMUSCLE_CACHE": str(folder / "cache"), "NUMBA_CACHE_DIR": ""},
        stdin=subprocess.PIPE,
    )


@pytest.mark.parametrize(
    "kind",
    [
        float64,
        types.boolean,
        float64[:, ::1],
        int64[:],
        types.Array(float64, 2, "C", readonly=True),
        types.UniTuple(int64, 3),
        types.NamedTuple([int64[::1], int64[::1], int64[::1], int64[:, ::1], float64[::1]], VertexGroups),
    ],
    ids=str,
)
def test_types_are_found_again_from_json(kind):
    assert type_of(json.loads(json.dumps(spelled(kind)))) == kind


def test_the_list_has_kernels_that_there_are_and_types_that_can_be_made():
    rows = json.loads(LIST.read_text(encoding="utf-8"))
    assert len(rows) > 50
    for module, name, arguments in rows:
        assert numba.extending.is_jitted(getattr(importlib.import_module(module), name)), name
        assert len(tuple(map(type_of, arguments))) == len(arguments)


def test_the_second_process_keeps_what_it_compiles_and_marks_that_it_is_done(tmp_path):
    process = begun(tmp_path, [SMALL])
    assert process.wait(120) == 0
    process.stdin.close()
    kernels = tmp_path / "cache" / "kernels"
    assert [file.name.partition("-")[0] for file in kernels.rglob("*.nbi")] == ["surface.mean_point"]
    assert list(kernels.glob(".compiled-*"))


def test_the_second_process_ends_with_the_first(tmp_path):
    rows = json.loads(LIST.read_text(encoding="utf-8"))
    process = begun(tmp_path, rows)
    process.stdin.close()
    process.wait(60)
    assert not list((tmp_path / "cache").rglob(".compiled-*"))


def test_no_process_begins_where_all_is_compiled(tmp_path, monkeypatch):
    begun_for = []
    monkeypatch.setattr(compile_ahead, "_second_process", lambda: begun_for.append(1))
    monkeypatch.setattr(compile_ahead, "kernel_folder", lambda: tmp_path)
    compile_ahead.compile_ahead()
    assert begun_for == [1]
    compile_ahead._mark(tmp_path).touch()
    compile_ahead.compile_ahead()
    assert begun_for == [1]
    monkeypatch.setattr(compile_ahead, "kernel_folder", lambda: None)
    compile_ahead.compile_ahead()
    assert begun_for == [1]
