"""The right hip of the LHDL data set as a scene: pelvis, femur, four muscles, landmarks, joint."""

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
from vtkmodules.vtkFiltersCore import vtkCleanPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.data import toml_table
from vtkmuscle.data.arrays import checked_surface, surface_from
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.io import read_msf, read_surface, write_polydata, write_text
from vtkmuscle.io.writing import file_digest, replacing, write_json
from vtkmuscle.plotting.views import merged
from vtkmuscle.scene.writing import write_areas
from vtkmuscle.scenes import Scene

_DATA = toml_table("vtkmuscle", "public_data.toml")
#: Name, title, server of raw files of public repositories, and licence of the data set.
NAME, TITLE, HOST, LICENCE = (_DATA[key] for key in ("name", "title", "host", "licence"))
#: Path of each file at the host, pinned to a commit, and its SHA-256 where that is known.
FILES: dict[str, tuple[str, str | None]] = {
    name: (f"{_DATA['folders'][folder]}/{path}", digest[0] if digest else None)
    for name, (folder, path, *digest) in _DATA["files"].items()
}
#: Muscles of the data set.
_MUSCLES = ("gluteus_maximus", "gluteus_medius", "iliacus", "adductor_brevis")
#: Longest wait for a connection and for each part of an answer [s], twice pip's; tries after a failure.
PATIENCE, RETRIES = 30.0, 2


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
        write_hip_scene(downloads, staging)
        Scene.load(staging / "scene.toml")
        write_text(staging / "LICENCE.txt", LICENCE)
        write_json(staging / "sources.json", sources, indent=1)
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


def write_hip_scene(downloads: Path, folder: Path) -> None:
    """Write the scene of the downloaded files: four muscles over flexion of the hip."""
    write_polydata(folder / "bones/pelvis.vtp", merged(map(_bone, sorted(downloads.glob("pelvis_*.vtk")))))
    write_polydata(folder / "bones/femur_r.vtp", _bone(downloads / "femur_r.vtk"))
    clouds = read_msf(downloads / "landmarks.nms")
    fibres, muscles = {"template": "parallel", "n_fibres": 100, "resolution": 15}, {}
    for name in _MUSCLES:
        write_polydata(folder / f"muscles/{name}.vtp", read_surface(downloads / f"{name}.vtk"))
        areas = _attachments(name, clouds, folder)
        muscles[name] = {"surface": f"muscles/{name}.vtp", "fibres": fibres, "attachments": areas}
    tables = _DATA["scene"] | {"muscles": muscles}
    model = tables["opensim"]["model"]
    with replacing(folder / model) as partial:
        shutil.copyfile(downloads / model, partial)
    header = "# The right hip of the LHDL data set; see LICENCE.txt.\n"
    write_text(folder / "scene.toml", header + tomli_w.dumps(tables, indent=2))


def _attachments(muscle: str, clouds: Mapping[str, Mapping[str, Floats]], folder: Path) -> Any:
    """Write a muscle's landmarks; return the ``attachments``, an entry of the scene."""
    if muscle not in _DATA["areas"]:
        return {"estimate": ["pelvis", "femur_r"]}
    areas = []
    for area in _DATA["areas"][muscle]:
        role, bone = ("origin", "pelvis") if area["cloud"].startswith("Ori") else ("insertion", "femur_r")
        points = np.array(list(clouds[f"LC_SET_{area['cloud']}"].values()))
        chosen = points[area["points"]] if "points" in area else points
        areas.append(AttachmentArea(role, bone, chosen, area.get("closed", True)))
    return write_areas(folder, muscle, areas)


def _bone(path: Path) -> vtkPolyData:
    """Return a clean bone with outward triangles, without repeated and loose points."""
    clean = vtkCleanPolyData(input_data=read_surface(path), tolerance=0.0, convert_polys_to_lines=False)
    points, triangles = checked_surface(clean.update().output, path.name)
    return surface_from(points, triangles if signed_volume(points, triangles) > 0 else triangles[:, ::-1])
