"""Keys of finished work: digests of all inputs."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkDataArray
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.run.report_values import version_of
from vtkmuscle.scene.data import Muscle, SceneData

#: Parts of the package that only start runs or show results.
_SHOWING = ("cli", "paraview", "plotting", "report/")
#: Fields that no frame of a muscle depends on, and why; all others count.
IRRELEVANT: Mapping[str, str] = MappingProxyType(
    {
        "SceneData.files": "where it was read from; what was read counts",
        "Muscle.literature": "drawn beside the curves of a finished run",
    }
)
#: Packages that have a part in the numbers.
_PACKAGES = ("numpy", "scipy", "numba", "vtk")
#: The key of a file of which the content counts, not the name.
_FILE = "template_file"


def muscle_keys(scene: SceneData, numbers: range) -> dict[str, str]:
    """Return the key of each muscle of a scene.

    A key is a digest of all inputs of the muscle's frames: the muscle and the scene without
    :data:`IRRELEVANT` fields, the numbers of the kept frames, this package's source, and the versions of the
    packages used in the computation. Muscles in possible contact also depend on the preceding muscles of the
    scene.
    """
    shared = _relevant(scene, SceneData)
    del shared["muscles"]  # each has a key of its own
    common = digest_of([code_digest(), list(numbers), shared])
    keys: dict[str, str] = {}
    for name, muscle in scene.muscles.items():
        before = list(keys.values()) if scene.muscle_contact != "off" else []
        keys[name] = digest_of([common, before, name, _relevant(muscle, Muscle)])
    return keys


def _relevant(value: Any, kind: type) -> dict[str, Any]:
    names = (field.name for field in fields(kind))
    return {name: getattr(value, name) for name in names if f"{kind.__name__}.{name}" not in IRRELEVANT}


def digest_of(value: Any) -> str:
    """Return a digest of a scene or value.

    All parts of the value count.
    """
    digest = hashlib.sha256()
    _feed(digest, value)
    return digest.hexdigest()


def _feed(digest: Any, value: Any) -> None:
    # Importing PyVista changes what VTK's own classes are called.
    kind = "vtkPolyData" if isinstance(value, vtkPolyData) else type(value).__name__
    digest.update(f"{kind}(".encode())
    if isinstance(value, vtkPolyData):
        _feed_surface(digest, value)
    elif isinstance(value, np.ndarray):
        digest.update(f"{value.dtype} {value.shape}".encode())
        digest.update(np.ascontiguousarray(value).tobytes())
    elif is_dataclass(value):
        for field in fields(value):
            if not (isinstance(value, SceneData) and field.name == "files"):
                _feed(digest, (field.name, getattr(value, field.name)))
    elif isinstance(value, Mapping):
        # In order: muscles yield to those before them, and points are fixed to bones by number. The order of
        # settings says nothing, and differs from process to process.
        ordered = any(isinstance(one, vtkPolyData) or is_dataclass(one) for one in value.values())
        for key, one in value.items() if ordered else sorted(value.items(), key=lambda item: str(item[0])):
            _feed(digest, (key, Path(one).read_bytes() if key == _FILE and one is not None else one))
    elif isinstance(value, list | tuple):
        for part in value:
            _feed(digest, part)
    else:
        digest.update(repr(value).encode())
    digest.update(b")")


def _feed_surface(digest: Any, data: vtkPolyData) -> None:
    points = data.GetPoints()
    _feed(digest, None if points is None else vtk_to_numpy(points.GetData()).astype(np.float64))
    for cells in (data.GetVerts(), data.GetLines(), data.GetPolys(), data.GetStrips()):
        for ids in (cells.GetOffsetsArray(), cells.GetConnectivityArray()):
            _feed(digest, vtk_to_numpy(ids).astype(np.int64))  # VTK chooses how it keeps them
    for arrays in (data.GetPointData(), data.GetCellData(), data.GetFieldData()):
        for number in range(arrays.GetNumberOfArrays()):
            one = arrays.GetAbstractArray(number)
            if isinstance(one, vtkDataArray):
                _feed(digest, (one.GetName(), vtk_to_numpy(one)))
            else:
                values = [one.GetValue(i) for i in range(one.GetNumberOfValues())]
                _feed(digest, (one.GetName(), values))


@cache
def code_digest() -> str:
    """Return a digest of the computing code.

    Source without :data:`_SHOWING`, and further packages.
    """
    root = Path(__file__).parents[2]
    digest = hashlib.sha256()
    for package in _PACKAGES:
        digest.update(f"{package} {version_of(package)}\n".encode())
    for file in sorted(root.rglob("*.py")):
        name = file.relative_to(root).as_posix()
        if not name.startswith(_SHOWING):
            digest.update(name.encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()
