"""Keys of finished work: digests of all inputs."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from vtkmodules.vtkCommonCore import vtkDataArray
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.data.arrays import points_of
from vtkmuscle.run.report_values import version_of
from vtkmuscle.scene.data import Muscle, SceneData

#: Parts of the package that only start runs or show results.
_SHOWING = ("cli", "paraview", "plotting", "report/")
#: Fields that no frame of a muscle depends on, and why; all others count.
IRRELEVANT: Mapping[str, str] = MappingProxyType(
    {
        "SceneData.files": "where it was read from; what was read counts",
        "SceneData.guessed": "judged anew in every run",
        "Muscle.literature": "drawn beside the curves of a finished run",
        "Muscle.muscle": "judged anew in every run",
    }
)
#: Packages that have a part in the numbers.
_PACKAGES = ("numpy", "scipy", "numba", "vtk")


def muscle_keys(scene: SceneData, numbers: range) -> dict[str, str]:
    """Return the key of each muscle of a scene.

    A key is a digest of all inputs of the muscle's frames: the muscle and the scene without
    :data:`IRRELEVANT` fields, the numbers of the kept frames, this package's source, and the versions of the
    packages used in the computation. Muscles in possible contact also depend on the preceding muscles of the
    scene.
    """
    shared = _relevant(scene, SceneData)
    del shared["muscles"]  # each has a key of its own
    shared["bones"] = list(scene.bones.items())  # in order: points are fixed to bones by number
    common = digest_of([code_digest(), list(numbers), shared])
    keys: dict[str, str] = {}
    for name, muscle in scene.muscles.items():
        before = list(keys.values()) if scene.muscle_contact != "off" else []
        template = (muscle.fibres or {}).get("template_file")
        content = None if template is None else Path(template).read_text(encoding="utf-8")
        keys[name] = digest_of([common, before, name, content, _relevant(muscle, Muscle)])
    return keys


def _relevant(value: Any, kind: type) -> dict[str, Any]:
    names = (field.name for field in fields(kind))
    return {name: getattr(value, name) for name in names if f"{kind.__name__}.{name}" not in IRRELEVANT}


def digest_of(value: Any) -> str:
    """Return a digest of all parts of a value; the order of mappings does not count."""
    return hashlib.sha256(json.dumps(value, default=_parts, sort_keys=True).encode()).hexdigest()


def _parts(value: Any) -> Any:
    """Return the parts of a value that JSON does not know."""
    if isinstance(value, vtkPolyData):
        cells = (value.GetVerts(), value.GetLines(), value.GetPolys(), value.GetStrips())
        ids = [array for kind in cells for array in (kind.GetOffsetsArray(), kind.GetConnectivityArray())]
        kinds = (value.GetPointData(), value.GetCellData(), value.GetFieldData())
        named = [kind.GetAbstractArray(i) for kind in kinds for i in range(kind.GetNumberOfArrays())]
        # VTK chooses how it keeps ids.
        return [points_of(value), *(np.asarray(array, np.int64) for array in ids), *map(_named, named)]
    if isinstance(value, np.ndarray):
        digest = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
        return [str(value.dtype), value.shape, digest]
    if is_dataclass(value):
        return {field.name: getattr(value, field.name) for field in fields(value)}
    return dict(value) if isinstance(value, Mapping) else repr(value)


def _named(array: Any) -> Any:
    if isinstance(array, vtkDataArray):
        return array.GetName(), np.asarray(array)
    return array.GetName(), [array.GetValue(i) for i in range(array.GetNumberOfValues())]


@cache
def code_digest() -> str:
    """Return a digest of the computing code: source without :data:`_SHOWING`, and further packages."""
    root = Path(__file__).parents[2]
    digest = hashlib.sha256("".join(f"{package} {version_of(package)}\n" for package in _PACKAGES).encode())
    for file in sorted([*root.rglob("*.py"), *root.rglob("*.toml")]):
        name = file.relative_to(root).as_posix()
        if not name.startswith(_SHOWING):
            digest.update(name.encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()
