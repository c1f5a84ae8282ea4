"""Finished settings on disk, so that none is run again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData

import vtkmuscle
from vtkmuscle.data.arrays import points_of
from vtkmuscle.io.writing import replacing, write_text
from vtkmuscle.scene.data import SceneData
from vtkmuscle.tradeoff.trial import Trial

#: Parts of the package that only show what came out.
_SHOWING = ("tradeoff/plots.py", "tradeoff/table.py")
#: Fields of a scene that its result does not depend on: where it was read from.
_NOT_SCENE = ("files",)


class Records:
    """A folder with one file per finished setting: figures as JSON, a reference's trials as arrays.

    A file's name is a digest of the scene, the frames that are compared, the source of the package and the
    setting, so that a change of any of them runs it anew and the old file stays for what it was. A file is
    moved into place complete.

    Parameters
    ----------
    folder : Path
        Made where it does not exist.
    scene : SceneData
        What is run.
    compared : sequence of int
        Numbers of the frames that are compared.
    """

    def __init__(self, folder: Path, scene: SceneData, compared: Sequence[int]) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self._what = [digest_of(scene), list(compared), code_digest()]

    def path(self, key: Any, ending: str) -> Path:
        """Return the file of a JSON-able key."""
        text = json.dumps([self._what, key], sort_keys=True)
        return self._folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}{ending}"

    def figures(self, key: Any, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """Return the figures that are kept of a key, made and kept where there are none."""
        path = self.path(key, ".json")
        if not path.is_file():
            record = {"key": key, "figures": make()}
            write_text(path, json.dumps(record, indent=1, allow_nan=False) + "\n")
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))["figures"]
        return found

    def trial(self, key: Any, make: Callable[[], Trial]) -> Trial:
        """Return the trial that is kept of a key, made and kept where there is none."""
        path = self.path(key, ".npz")
        if not path.is_file():
            facts = dict(vars(make()))
            arrays = {name: facts.pop(name) for name in ("points", "lengths")}
            with replacing(path) as beside, beside.open("wb") as file:
                np.savez_compressed(file, allow_pickle=False, facts=np.array(json.dumps(facts)), **arrays)
        with np.load(path) as kept:
            return Trial(kept["points"], kept["lengths"], **json.loads(str(kept["facts"])))


def digest_of(value: Any) -> str:
    """Return a digest of all that a scene, or a value in it, is made of."""
    digest = hashlib.sha256()
    _feed(digest, value)
    return digest.hexdigest()


def _feed(digest: Any, value: Any) -> None:
    digest.update(f"{type(value).__name__}(".encode())
    if isinstance(value, vtkPolyData):
        _feed(digest, points_of(value))
        for cells in (value.GetVerts(), value.GetLines(), value.GetPolys(), value.GetStrips()):
            _feed(digest, vtk_to_numpy(cells.GetOffsetsArray()))
            _feed(digest, vtk_to_numpy(cells.GetConnectivityArray()))
    elif isinstance(value, np.ndarray):
        digest.update(f"{value.dtype} {value.shape}".encode())
        digest.update(np.ascontiguousarray(value).tobytes())
    elif is_dataclass(value):
        for field in fields(value):
            if not (isinstance(value, SceneData) and field.name in _NOT_SCENE):
                _feed(digest, (field.name, getattr(value, field.name)))
    elif isinstance(value, Mapping):
        _feed(digest, list(value.items()))  # in order: muscles yield to those before them
    elif isinstance(value, list | tuple):
        for part in value:
            _feed(digest, part)
    else:
        digest.update(repr(value).encode())
    digest.update(b")")


def code_digest() -> str:
    """Return a digest of the package's source, but what only shows results."""
    root = Path(vtkmuscle.__file__).parent
    files = {file.relative_to(root).as_posix(): file for file in sorted(root.rglob("*.py"))}
    digest = hashlib.sha256()
    for name, file in files.items():
        if name not in _SHOWING:
            digest.update(name.encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()
