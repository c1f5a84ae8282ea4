"""The right hip of the LHDL data set: pelvis, femur, four muscles, their landmarks, and the joint."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkAppendPolyData, vtkCleanPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import points_of, surface_from, triangles_of
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.fetch.datasets import AGAIN, DataSet, RemoteFile, check_figures
from vtkmuscle.io import read_surface, write_polydata, write_text
from vtkmuscle.io.msf import landmarks_of, read_msf
from vtkmuscle.scene.writing import write_areas

_LICENCE = """\
LHDL right hip: bones, muscles and landmarks of the Living Human Digital Library

Bones, muscles and landmarks: (c) the LHDL consortium (Istituto Ortopedico Rizzoli; Universite Libre de
  Bruxelles),
  Creative Commons Attribution-NonCommercial-ShareAlike 2.0 Belgium (CC BY-NC-SA 2.0 BE),
  https://creativecommons.org/licenses/by-nc-sa/2.0/be/
  You name the consortium; you do not use the data for commercial purposes; what you derive from them,
  pictures included, goes on under the same licence.
  Viceconti, Clapworthy, Van Sint Jan 2008, J Physiol Sci 58:441-446.
Packaging and OpenSim model: (c) 2020 Modenese L., Kohout J., Apache License 2.0,
  https://github.com/modenaxe/3d-muscles; cite Modenese, Kohout 2020, doi:10.1007/s10439-020-02490-4.
Surfaces of the muscles as published with Kohout, Cervenka 2021, doi:10.1007/978-3-030-72379-8_24,
  https://github.com/cervenkam/muscle-deformation-PBD.
"""

_HIP, _PBD = "modenaxe/3d-muscles", "cervenkam/muscle-deformation-PBD"
_HIP_DATA = "b4e8f62a82440354280225172287ceb2ffad7678"
_HIP_MODEL = "778f2e6f3bcf78455b96decc1dda94d34c84dff0"
_PBD_DATA = "66cce66944a8e81cb9bbc82f845bd45beccf0d9b"
_FOLDER = "_LHDL_hip_r_dataset/_LHDL_hip_r_dataset"
_MODEL = "LHDL_hip_r.osim"
_TREE = "landmarks.nms"

#: Number of the file, triangles, and bounds in x, y and z [mm].
_BONES = {
    "sacrum": (523, 89944, (178.82, 305.33, 233.77, 345.76, -457.37, -296.09)),
    "iliac_l": (524, 89998, (235.86, 387.48, 181.02, 323.62, -499.35, -283.92)),
    "iliac_r": (525, 89992, (94.21, 234.53, 178.28, 321.29, -493.75, -280.95)),
    "femur_r": (123, 84998, (79.38, 167.5, 220.08, 314.69, -855.17, -409.73)),
}
#: The pelvis is three closed pieces.
_PELVIS = ("sacrum", "iliac_l", "iliac_r")
_MUSCLES = {
    "gluteus_maximus": (0, 19752, (70.78, 229.91, 276.55, 348.05, -563.17, -304.06)),
    "gluteus_medius": (1, 10622, (75.22, 171.12, 192.84, 293.48, -441.8, -286.56)),
    "iliacus": (2, 13858, (118.92, 176.18, 189.95, 270.65, -491.87, -289.12)),
    "adductor_brevis": (3, 17124, (113.89, 227.32, 199.69, 281.29, -534.07, -464.68)),
}
#: Landmarks of each cloud, and their mean [mm].
_CLOUDS = {
    "Ori_1_R_M081_Glut_Max": (21, (181.01, 305.12, -338.91)),
    "Ori_2_R_M081_Glut_Max": (22, (205.54, 325.99, -380.24)),
    "Ins_1_R_M081_Glut_Max": (11, (104.99, 281.51, -519.14)),
    "Ori_1_R_M082_Glut_Med": (38, (139.90, 259.93, -326.52)),
    "Ins_1_R_M082_Glut_Med": (17, (90.18, 270.32, -432.80)),
    "Ori_1_R_M091_Iliacus": (40, (146.85, 237.08, -335.38)),
    "Ins_1_R_M091_Iliacus": (7, (131.99, 264.61, -481.25)),
}
#: Cloud of each area, and which of its landmarks: in the order of the file a ring, or a line if the area is
#: open. The second cloud of the gluteus maximus is a ring of 16 and six more, here in the order of the
#: shortest closed way; its third cloud is on the tibia, which is absent. The adductor brevis has none.
_ALL = slice(None)
_AREAS: dict[str, list[tuple[str, slice | list[int]]]] = {
    "gluteus_maximus": [
        ("Ori_1_R_M081_Glut_Max", _ALL),
        ("Ori_2_R_M081_Glut_Max", slice(16)),
        ("Ori_2_R_M081_Glut_Max", [16, 17, 18, 21, 19, 20]),
        ("Ins_1_R_M081_Glut_Max", _ALL),
    ],
    "gluteus_medius": [("Ori_1_R_M082_Glut_Med", _ALL), ("Ins_1_R_M082_Glut_Med", _ALL)],
    "iliacus": [("Ori_1_R_M091_Iliacus", _ALL), ("Ins_1_R_M091_Iliacus", _ALL)],
}
_OPEN = ("Ins_1_R_M081_Glut_Max", "Ins_1_R_M091_Iliacus")
#: The hip in the pose of the scan, in the model's coordinates [degrees].
_REST = {"hip_flexion_r": 1.576, "hip_adduction_r": -4.727, "hip_rotation_r": -5.290}


def _build(files: Mapping[str, Path], folder: Path) -> Path:
    """Write the scene: four muscles over flexion of the hip."""
    pieces = {name: _bone(files[f"{name}.vtk"]) for name in _BONES}
    pelvis = vtkAppendPolyData()
    for name in _PELVIS:
        pelvis.AddInputData(pieces[name])
    pelvis.Update()
    write_polydata(folder / "bones/pelvis.vtp", pelvis.GetOutput())
    write_polydata(folder / "bones/femur_r.vtp", pieces["femur_r"])
    clouds = _checked_clouds(files[_TREE])
    muscles: dict[str, Any] = {}
    for name in _MUSCLES:
        surface = read_surface(files[f"{name}.vtk"])
        _check_surface(name, surface)
        write_polydata(folder / f"muscles/{name}.vtp", surface)
        muscles[name] = {
            "surface": f"muscles/{name}.vtp",
            "fibres": {"template": "parallel", "n_fibres": 100, "resolution": 15},
            "attachments": _attachments(name, clouds, folder),
        }
    shutil.copyfile(files[_MODEL], folder / _MODEL)
    rest = _REST["hip_flexion_r"]
    tables = {
        "name": "lhdl_hip",
        "units": "mm",
        "bones": {bone: {"surface": f"bones/{bone}.vtp"} for bone in ("pelvis", "femur_r")},
        "opensim": {"model": _MODEL, "frame": "pelvis", "fixed": "pelvis", "rest": _REST},
        "motion": {"grid": {"hip_flexion_r": [rest, rest + 88.0, 2.0]}},
        "muscles": muscles,
    }
    path = folder / "scene.toml"
    write_text(
        path, "# The right hip of the LHDL data set; see LICENCE.txt.\n" + tomli_w.dumps(tables, indent=2)
    )
    return path


def _attachments(muscle: str, clouds: Mapping[str, Floats], folder: Path) -> Any:
    """Write a muscle's landmarks; return its ``attachments`` in the scene."""
    if muscle not in _AREAS:
        return {"estimate": ["pelvis", "femur_r"]}
    areas = []
    for cloud, which in _AREAS[muscle]:
        role, bone = ("origin", "pelvis") if cloud.startswith("Ori") else ("insertion", "femur_r")
        areas.append(AttachmentArea(role, bone, clouds[cloud][which], cloud not in _OPEN))
    return write_areas(folder, muscle, areas)


def _checked_clouds(tree: Path) -> dict[str, Floats]:
    """Return the landmarks of each cloud (n, 3) [mm]."""
    found = landmarks_of(read_msf(tree))
    clouds = {}
    for name, (count, middle) in _CLOUDS.items():
        if f"LC_SET_{name}" not in found:
            raise InputError(tree.name, f"the cloud LC_SET_{name} is not there", AGAIN)
        clouds[name] = points = np.array(list(found[f"LC_SET_{name}"].values()))
        known = count, np.array(middle)
        check_figures(f"{tree.name}, LC_SET_{name}", known, (len(points), points.mean(axis=0)))
    return clouds


def _bone(path: Path) -> vtkPolyData:
    """Return a bone without repeated and loose points, its triangles outward."""
    clean = vtkCleanPolyData(input_data=read_surface(path), tolerance=0.0, convert_polys_to_lines=False)
    clean.Update()
    points = points_of(clean.GetOutput())
    triangles = triangles_of(clean.GetOutput(), path.name)
    outward = triangles if signed_volume(points, triangles) > 0 else triangles[:, ::-1]
    surface = surface_from(points, outward)
    _check_surface(path.stem, surface)
    return surface


def _check_surface(name: str, surface: vtkPolyData) -> None:
    _, triangles, bounds = (_BONES | _MUSCLES)[name]
    known = triangles, np.array(bounds)
    check_figures(f"{name}.vtk", known, (surface.GetNumberOfPolys(), np.array(surface.GetBounds())))


LHDL_HIP = DataSet(
    title="right hip of a cadaver: pelvis, femur, four muscles, landmarks, OpenSim's joint",
    licence=_LICENCE,
    files=(
        *(
            RemoteFile(f"{name}.vtk", _HIP, _HIP_DATA, f"{_FOLDER}.{number}.vtk")
            for name, (number, *_) in _BONES.items()
        ),
        *(
            RemoteFile(f"{name}.vtk", _PBD, _PBD_DATA, f"data/muscle{number}_s1.vtk")
            for name, (number, *_) in _MUSCLES.items()
        ),
        RemoteFile(_TREE, _HIP, _HIP_DATA, f"{_FOLDER}.nms"),
        RemoteFile(
            *(_MODEL, _HIP, _HIP_MODEL, f"a_MSK_model/a_MSK_model/{_MODEL}"),
            sha256="18c6d750bfccb9f9ec16324bef866bb9aab247d70e45ada12f570c964cb2edcc",
        ),
    ),
    build=_build,
)
