"""Distance grids kept on disk, so that a bone is measured once.

A file is named after the content that its grid was built from, and begins with the checksum of the rest: a
file that was cut short or changed is built anew. Files are written beside their place and moved there in
one step, so that processes that build the same grid at once do each other no harm.
"""

from __future__ import annotations

import hashlib
import io
import os
import tempfile
from contextlib import suppress
from pathlib import Path

import numpy as np

from vtkmuscle.core.cache_folder import cache_folder, warn_of_folder
from vtkmuscle.core.collision.distance_blocks import SIDE
from vtkmuscle.core.collision.distance_grid import Corners, DistanceGrid, build_distance_grid, warn_of
from vtkmuscle.core.files import check_is_file
from vtkmuscle.core.types import Floats, Ints

#: To be raised with every change of what is stored or how it is computed.
FORMAT = 3

#: What the files of a cache may take [bytes]; beyond it the ones longest unused are removed.
MOST_BYTES = 2 * 1024**3

_MAGIC = b"vtkmuscle distance grid\n"
_SUFFIX = ".distances"


def cached_distance_grid(
    surface: tuple[Floats, Ints],
    *,
    cell: float,
    band: float | None = None,
    region: Corners | None = None,
    what: str = "distance grid",
) -> DistanceGrid:
    """Return the signed distance from a surface, from disk if it was built before.

    Parameters
    ----------
    surface : tuple of (n, 3) array, (m, 3) int array
        Positions in the rest pose [mm]; point ids.
    cell, band, region, what
        As for :func:`~vtkmuscle.core.collision.distance_grid.build_distance_grid`.

    Returns
    -------
    DistanceGrid
        Bit by bit the same, whether it was read or built.

    Warns
    -----
    UserWarning
        As build_distance_grid, also where the grid was read; and once per folder that cannot be used.
    """
    folder = cache_folder()
    path = None
    if folder is not None:
        path = folder / (_key(surface, cell, band, region) + _SUFFIX)
        grid = _read(path)
        if grid is not None:
            warn_of(grid.remarks, what)
            return grid
    grid = build_distance_grid(*surface, cell=cell, band=band, region=region, what=what)
    if path is not None:
        _write(path, grid)
    return grid


def _key(surface: tuple[Floats, Ints], cell: float, band: float | None, region: Corners | None) -> str:
    settings = [FORMAT, float(cell), None if band is None else float(band)]
    settings += [None if region is None else np.asarray(region, dtype=np.float64).tolist()]
    digest = hashlib.sha256(repr(settings).encode())
    for array, kind in zip(surface, ("<f8", "<i8"), strict=True):
        stored = np.ascontiguousarray(array, dtype=kind)
        digest.update(repr(stored.shape).encode())
        digest.update(stored.data)
    return digest.hexdigest()


def _read(path: Path) -> DistanceGrid | None:
    """Return the grid of a file, None where there is none or it is not whole."""
    try:
        check_is_file(path)
        content = path.read_bytes()
    except (OSError, ValueError):
        return None
    with suppress(OSError):  # a cache that can only be read serves all the same
        os.utime(path)  # it is in use: others are removed before it
    head = len(_MAGIC) + hashlib.sha256().digest_size
    body = memoryview(content)[head:]
    if content[: len(_MAGIC)] != _MAGIC or hashlib.sha256(body).digest() != content[len(_MAGIC) : head]:
        return None
    stream = io.BytesIO(body)
    try:
        frame, table, values, remarks = (np.load(stream, allow_pickle=False) for _ in range(4))
    except (ValueError, EOFError):  # of another program, by its own checksum
        return None
    fits = (
        (frame.shape, table.ndim, values.shape[1:]) == ((5,), 3, (SIDE + 1,) * 3)
        and (frame.dtype, table.dtype, values.dtype) == (np.float64, np.int32, np.float32)
        and table.min(initial=-1) >= -1
        and table.max(initial=-1) < len(values)
    )
    if not fits:  # look-ups do not check what they index
        return None
    return DistanceGrid(
        frame[:3].copy(), float(frame[3]), float(frame[4]), table, values, tuple(remarks.tolist())
    )


def _write(path: Path, grid: DistanceGrid) -> None:
    """Write a grid to a file; warn where that is not possible."""
    stream = io.BytesIO()
    frame = np.array([*grid.origin, grid.cell, grid.band])
    remarks = np.array(grid.remarks, dtype=np.str_)
    for array in (frame, grid.table, grid.values, remarks):
        np.save(stream, array, allow_pickle=False)
    body = stream.getbuffer()
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".part")
        with os.fdopen(handle, "wb") as file:
            file.write(_MAGIC + hashlib.sha256(body).digest())
            file.write(body)
        os.replace(temporary, path)
        _make_room(path)
    except OSError as error:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
        warn_of_folder(path.parent, error, "distance grids", "built anew each time")


def _make_room(newest: Path) -> None:
    """Remove the files longest unused until the rest fits."""
    files = []
    for path in newest.parent.glob("*" + _SUFFIX):
        try:
            files.append((path.stat().st_mtime, path.stat().st_size, path))
        except OSError:  # another process has removed it
            continue
    total = sum(size for _, size, _ in files)
    for _, size, path in sorted(files):
        if total <= MOST_BYTES:
            break
        if path != newest:
            path.unlink(missing_ok=True)
            total -= size
