"""The right hip of the LHDL data set as a scene: pelvis, femur, four muscles, landmarks, joint."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pooch
import tomli_w
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkAppendPolyData, vtkCleanPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.data.arrays import points_of, surface_from, triangles_of
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.io import read_surface, write_polydata, write_text
from vtkmuscle.io.msf import landmarks_of, read_msf
from vtkmuscle.io.writing import file_digest, replacing
from vtkmuscle.scene.writing import write_areas
from vtkmuscle.scenes import Scene

#: Name and title of the data set.
NAME = "lhdl-hip"
TITLE = "right hip of a cadaver: pelvis, femur, four muscles, landmarks, OpenSim's joint"
LICENCE = """\
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
#: The server of raw files of public repositories.
HOST = "https://raw.githubusercontent.com"
#: Longest wait for a connection and for each part of an answer [s], and further tries after a failure.
PATIENCE, RETRIES = 30.0, 2

_HIP = "modenaxe/3d-muscles/b4e8f62a82440354280225172287ceb2ffad7678/_LHDL_hip_r_dataset/_LHDL_hip_r_dataset"
_PBD = "cervenkam/muscle-deformation-PBD/66cce66944a8e81cb9bbc82f845bd45beccf0d9b/data"
_MSK = "modenaxe/3d-muscles/778f2e6f3bcf78455b96decc1dda94d34c84dff0/a_MSK_model/a_MSK_model"
_MODEL, _TREE = "LHDL_hip_r.osim", "landmarks.nms"
#: Path of each bone at the host; the pelvis is three closed pieces.
_PELVIS = {f"pelvis_{number}": f"{_HIP}.{number}.vtk" for number in (523, 524, 525)}
_FEMUR = {"femur_r": f"{_HIP}.123.vtk"}
_MUSCLES = {
    name: f"{_PBD}/muscle{number}_s1.vtk"
    for number, name in enumerate(("gluteus_maximus", "gluteus_medius", "iliacus", "adductor_brevis"))
}
#: Path of each file at the host, pinned to a commit, and its SHA-256 where that is known.
FILES: dict[str, tuple[str, str | None]] = {
    **{f"{name}.vtk": (path, None) for name, path in (_PELVIS | _FEMUR | _MUSCLES).items()},
    _TREE: (f"{_HIP}.nms", None),
    _MODEL: (f"{_MSK}/{_MODEL}", "18c6d750bfccb9f9ec16324bef866bb9aab247d70e45ada12f570c964cb2edcc"),
}
#: Cloud of each area, and its landmarks: in the order of the file a ring, or a line if the area is open.
#: The second cloud of the gluteus maximus is a ring of 16 and six more, here in the order of the
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


def fetch(
    name: str = NAME,
    folder: str | PathLike[str] | None = None,
    *,
    accept_licence: bool = False,
    host: str = HOST,
    announce: Callable[[str], None] = lambda words: None,
) -> Path:
    """Download the LHDL hip as a scene.

    Files come from pinned commits of the publishing repositories. A failed download is tried again twice.
    After a failure no files remain.

    Parameters
    ----------
    name : str
        ``"lhdl-hip"``, the only data set.
    folder : path, optional
        New folder of the scene. By default ``name`` in the working folder.
    accept_licence : bool, optional
        Whether you accept :data:`LICENCE`.
    host : str, optional
        A mirror with files at ``OWNER/REPOSITORY/COMMIT/PATH``.
    announce : callable, optional
        Called with a line of text for each file.

    Returns
    -------
    Path
        The scene.toml. The folder also has ``LICENCE.txt`` and ``sources.json``: the address and SHA-256
        of each file.

    Raises
    ------
    InputError
        If the data set is unknown, the licence is not accepted, the folder exists, or a file cannot be
        downloaded or differs from the published one.

    Examples
    --------
    >>> from vtkmuscle import fetch
    >>> fetch("lhdl-hip")
    Traceback (most recent call last):
        ...
    vtkmuscle.core.errors.InputError: lhdl-hip: the licence is not accepted; pass ...
    """
    if name != NAME:
        raise InputError("", f"there is no data set {name!r}; {suggestion(name, [NAME])}")
    if not accept_licence:
        raise InputError(name, "the licence is not accepted", "pass accept_licence=True to accept")
    target = Path(folder or name)
    if target.exists() or target.is_symlink():
        raise InputError(target, "the folder exists", "remove the folder, or name another")
    target.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent) as temporary:
        downloads, staging = Path(temporary) / "downloads", Path(temporary) / "scene"
        staging.mkdir()
        sources = []
        for number, (file, (path, sha256)) in enumerate(FILES.items(), start=1):
            url = f"{host.rstrip('/')}/{path}"
            announce(f"{number} of {len(FILES)}: {url}")
            _download(url, downloads, file, sha256)
            sources.append({"url": url, "sha256": file_digest(downloads / file), "known": bool(sha256)})
        announce("putting the scene together")
        write_scene(downloads, staging)
        Scene.load(staging / "scene.toml")
        write_text(staging / "LICENCE.txt", LICENCE)
        write_text(staging / "sources.json", json.dumps(sources, indent=1) + "\n")
        staging.rename(target)
    return target / "scene.toml"


def _download(url: str, folder: Path, name: str, sha256: str | None) -> None:
    """Download a file into a folder; a known SHA-256 is checked."""
    pooch.get_logger().setLevel("ERROR")  # failures are raised here
    registry = {name: sha256 and f"sha256:{sha256}"}
    source = pooch.create(folder, "", registry=registry, urls={name: url}, retry_if_failed=RETRIES)
    # Read at once: of a stream that fails the connection would stay open.
    downloader = pooch.HTTPDownloader(timeout=PATIENCE, stream=False)
    try:
        source.fetch(name, downloader=downloader)
    except (OSError, ValueError) as error:  # of requests too; of the checksum
        remedy = "check the network and the address, then try again"
        raise InputError(url, f"the download failed: {error}", remedy) from error


def write_scene(files: Path, folder: Path) -> None:
    """Write the scene of the downloaded files: four muscles over flexion of the hip."""
    pelvis = vtkAppendPolyData()
    for name in _PELVIS:
        pelvis.AddInputData(_bone(files / f"{name}.vtk"))
    pelvis.Update()
    write_polydata(folder / "bones/pelvis.vtp", pelvis.GetOutput())
    write_polydata(folder / "bones/femur_r.vtp", _bone(files / "femur_r.vtk"))
    clouds = landmarks_of(read_msf(files / _TREE))
    muscles: dict[str, Any] = {}
    for name in _MUSCLES:
        write_polydata(folder / f"muscles/{name}.vtp", read_surface(files / f"{name}.vtk"))
        muscles[name] = {
            "surface": f"muscles/{name}.vtp",
            "fibres": {"template": "parallel", "n_fibres": 100, "resolution": 15},
            "attachments": _attachments(name, clouds, folder),
        }
    with replacing(folder / _MODEL) as partial:
        shutil.copyfile(files / _MODEL, partial)
    rest = _REST["hip_flexion_r"]
    tables = {
        "name": "lhdl_hip",
        "units": "mm",
        "bones": {bone: {"surface": f"bones/{bone}.vtp"} for bone in ("pelvis", "femur_r")},
        "opensim": {"model": _MODEL, "frame": "pelvis", "fixed": "pelvis", "rest": _REST},
        "motion": {"grid": {"hip_flexion_r": [rest, rest + 88.0, 2.0]}},
        "muscles": muscles,
    }
    header = "# The right hip of the LHDL data set; see LICENCE.txt.\n"
    write_text(folder / "scene.toml", header + tomli_w.dumps(tables, indent=2))


def _attachments(muscle: str, clouds: Mapping[str, Mapping[str, Floats]], folder: Path) -> Any:
    """Write a muscle's landmarks; return the ``attachments``, an entry of the scene."""
    if muscle not in _AREAS:
        return {"estimate": ["pelvis", "femur_r"]}
    areas = []
    for cloud, which in _AREAS[muscle]:
        role, bone = ("origin", "pelvis") if cloud.startswith("Ori") else ("insertion", "femur_r")
        points = np.array(list(clouds[f"LC_SET_{cloud}"].values()))
        areas.append(AttachmentArea(role, bone, points[which], cloud not in _OPEN))
    return write_areas(folder, muscle, areas)


def _bone(path: Path) -> vtkPolyData:
    """Return a clean bone with outward triangles, without repeated and loose points."""
    clean = vtkCleanPolyData(input_data=read_surface(path), tolerance=0.0, convert_polys_to_lines=False)
    clean.Update()
    points = points_of(clean.GetOutput())
    triangles = triangles_of(clean.GetOutput(), path.name)
    return surface_from(points, triangles if signed_volume(points, triangles) > 0 else triangles[:, ::-1])
