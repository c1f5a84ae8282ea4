"""The cache of distance grids: what it keeps, and what it survives."""

import hashlib
import io
import multiprocessing
import warnings

import numpy as np
import pytest
from shapes import ball, box

from vtkmuscle.core.cache_folder import cache_folder
from vtkmuscle.core.collision import grid_cache
from vtkmuscle.core.collision.distance_grid import build_distance_grid
from vtkmuscle.core.collision.grid_cache import cached_distance_grid


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("VTKMUSCLE_CACHE", str(tmp_path / "grids"))
    return tmp_path / "grids"


@pytest.fixture
def builds(monkeypatch):
    """Count how often a grid is built."""
    calls = []

    def build(*surface, **settings):
        calls.append(settings)
        return build_distance_grid(*surface, **settings)

    monkeypatch.setattr(grid_cache, "build_distance_grid", build)
    return calls


def assert_same(one, other):
    np.testing.assert_array_equal(one.origin, other.origin)
    np.testing.assert_array_equal(one.table, other.table)
    np.testing.assert_array_equal(one.values, other.values)
    assert (one.cell, one.band, one.remarks) == (other.cell, other.band, other.remarks)
    assert one.values.dtype == other.values.dtype


def test_the_second_grid_is_read_and_the_same_bit_by_bit(folder, builds):
    grids = [cached_distance_grid(ball(), cell=1.0) for _ in range(2)]
    assert len(builds) == 1
    assert_same(*grids)
    assert len(list(folder.iterdir())) == 1


def test_whatever_changes_the_grid_makes_another(folder, builds):
    points, triangles = ball()
    cached_distance_grid((points, triangles), cell=1.0)
    cached_distance_grid((points, triangles), cell=1.1)
    cached_distance_grid((points, triangles), cell=1.0, band=3.0)
    cached_distance_grid((points, triangles), cell=1.0, region=((-1, -1, -1), (20, 1, 1)))
    cached_distance_grid((points + 1e-12, triangles), cell=1.0)
    cached_distance_grid((points, np.roll(triangles, 1, axis=0)), cell=1.0)
    assert len(builds) == 6
    cached_distance_grid((points, triangles.astype(np.int32)), cell=1.0)
    cached_distance_grid((points, triangles), cell=1.0, region=(np.full(3, -1.0), np.array([20.0, 1, 1])))
    assert len(builds) == 6


@pytest.mark.parametrize("fault", ["cut", "bit", "empty", "other"])
def test_a_corrupt_file_is_found_and_mended(folder, builds, fault):
    expected = cached_distance_grid(ball(), cell=1.0)
    (file,) = folder.iterdir()
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(
        {"cut": content[:-1000], "bit": content, "empty": b"", "other": b"something else" * 100}[fault]
    )
    assert_same(cached_distance_grid(ball(), cell=1.0), expected)
    assert len(builds) == 2
    assert_same(cached_distance_grid(ball(), cell=1.0), expected)
    assert len(builds) == 2


@pytest.mark.parametrize("arrays", [0, 2, 4])
def test_a_file_with_something_else_in_it_is_mended(folder, builds, arrays):
    expected = cached_distance_grid(ball(), cell=1.0)
    (file,) = folder.iterdir()
    stream = io.BytesIO()
    for _ in range(arrays):
        np.save(stream, np.full((2, 2, 2), 7))
    body = stream.getvalue()
    file.write_bytes(grid_cache._MAGIC + hashlib.sha256(body).digest() + body)
    assert_same(cached_distance_grid(ball(), cell=1.0), expected)
    assert len(builds) == 2


def test_a_cache_that_can_only_be_read_is_read(folder, builds, monkeypatch):
    cached_distance_grid(ball(), cell=1.0)

    def refuse(path):
        raise PermissionError(path)

    monkeypatch.setattr(grid_cache.os, "utime", refuse)
    cached_distance_grid(ball(), cell=1.0)
    assert len(builds) == 1


def test_what_is_wrong_with_a_bone_is_told_when_it_is_read_too(folder):
    points, triangles = box()
    for _ in range(2):
        with pytest.warns(UserWarning, match="open: 1 hole"):
            cached_distance_grid((points, triangles[1:]), cell=0.3)


def test_a_folder_that_cannot_be_used_gives_one_warning_and_the_grid(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("VTKMUSCLE_CACHE", str(tmp_path / "file" / "grids"))
    with pytest.warns(UserWarning, match="cannot be kept") as told:
        grid = cached_distance_grid(ball(), cell=1.0)
    assert len(told) == 1
    assert_same(grid, cached_distance_grid(ball(), cell=1.0))  # warnings are errors


def test_a_disk_that_is_full_leaves_no_part_of_a_file(folder, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(grid_cache.os, "replace", full)
    with pytest.warns(UserWarning, match="No space left"):
        cached_distance_grid(ball(), cell=1.0)
    assert list(folder.iterdir()) == []


def _build(number):
    warnings.simplefilter("error")
    return cached_distance_grid(ball(), cell=0.5).values.sum()


def test_processes_that_build_at_once_do_no_harm(folder):
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        sums = pool.map(_build, range(4), chunksize=1)
    assert len(set(sums)) == 1
    (file,) = folder.iterdir()
    assert grid_cache._read(file) is not None


def test_the_oldest_files_make_room(folder, builds, monkeypatch):
    cached_distance_grid(ball(), cell=1.0)
    (first,) = folder.iterdir()
    monkeypatch.setattr(grid_cache, "MOST_BYTES", int(1.5 * first.stat().st_size))
    cached_distance_grid(ball(), cell=1.001)
    (second,) = folder.iterdir()
    assert second != first


def test_where_the_cache_is(monkeypatch, tmp_path):
    monkeypatch.setenv("VTKMUSCLE_CACHE", str(tmp_path))
    assert cache_folder() == tmp_path
    monkeypatch.setenv("VTKMUSCLE_CACHE", "")
    assert cache_folder() is None
    monkeypatch.delenv("VTKMUSCLE_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "vtkmuscle"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder() == tmp_path / ".cache" / "vtkmuscle"


def test_an_empty_variable_turns_the_cache_off(monkeypatch, builds):
    monkeypatch.setenv("VTKMUSCLE_CACHE", "")
    for _ in range(2):
        cached_distance_grid(ball(), cell=1.0)
    assert len(builds) == 2
