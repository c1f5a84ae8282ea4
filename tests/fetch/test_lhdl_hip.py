"""The scene of the LHDL hip is put together from files of the kinds that are published."""

import hashlib
import json
import re

import numpy as np
import pytest
from file_server import serving
from vtkmodules.vtkIOLegacy import vtkPolyDataWriter

from vtkmuscle import Scene, fetch
from vtkmuscle.data.arrays import cell_array, points_of, surface_from, triangles_of
from vtkmuscle.io import read_surface
from vtkmuscle.public_data import FILES

LANDMARK = (
    '<Node Id="{i}" Name="{i}" Type="albaVMELandmark"><MatrixVector NumberOfItems="1"><Matrix TimeStamp="0">'
    "1 0 0 {x}\n0 1 0 {y}\n0 0 1 {z}\n0 0 0 1\n</Matrix></MatrixVector></Node>"
)


def tree_of(clouds):
    """Return a tree of NMSBuilder with clouds of landmarks."""
    nodes = []
    for name, points in clouds.items():
        inside = "".join(LANDMARK.format(i=i, x=x, y=y, z=z) for i, (x, y, z) in enumerate(points))
        nodes.append(
            f'<Node Name="{name}" Type="albaVMELandmarkCloud"><Children>{inside}</Children>'
            '<MatrixVector NumberOfItems="0"/></Node>'
        )
    group = f'<Node Name="Pelvis" Type="albaVMEGroup"><Children>{"".join(nodes)}</Children></Node>'
    return f'<MSF Version="2.2"><Root Name="root"><Children>{group}</Children></Root></MSF>'.encode()


def legacy(surface, path):
    """Return a surface as a binary .vtk file."""
    writer = vtkPolyDataWriter(input_data=surface, file_name=str(path))
    writer.SetFileTypeToBinary()
    writer.Write()
    return path.read_bytes()


@pytest.fixture(scope="module")
def published(lhdl_hip, tmp_path_factory):
    """Files as they are published, made from the data that are there: by name in the data set."""
    pelvis = read_surface(lhdl_hip / "bones" / "pelvis.vtp")
    points, triangles = points_of(pelvis), triangles_of(pelvis, "pelvis")
    part = cell_array(pelvis, "part", "pelvis")
    file = tmp_path_factory.mktemp("published") / "surface.vtk"
    files = {}
    for number, name in enumerate(("pelvis_523", "pelvis_524", "pelvis_525")):
        used, own = np.unique(triangles[part == number], return_inverse=True)
        with_loose_point = np.vstack([points[used], [[0.0, 0.0, 0.0]]])
        files[name] = legacy(surface_from(with_loose_point, own.reshape(-1, 3)), file)
    files["femur_r"] = legacy(read_surface(lhdl_hip / "bones" / "femur_r.vtp"), file)
    for name in ("gluteus_maximus", "gluteus_medius", "iliacus", "adductor_brevis"):
        files[name] = legacy(read_surface(lhdl_hip / "muscles" / f"{name}.vtp"), file)
    attachments = json.loads((lhdl_hip / "attachments" / "attachments.json").read_text())
    clouds = {one["nms_name"]: one["landmarks_xyz"] for one in attachments if not one["derived"]}
    files = {f"{name}.vtk": content for name, content in files.items()}
    files |= {"landmarks.nms": tree_of(clouds)}
    return files | {"LHDL_hip_r.osim": (lhdl_hip / "reference" / "LHDL_hip_r.osim").read_bytes()}


@pytest.mark.realdata
def test_the_fetched_hip_is_the_hip(published, lhdl_hip, tmp_path):
    with serving({path: published[name] for name, (path, _) in FILES.items()}) as (host, _):
        path = fetch("lhdl-hip", tmp_path / "hip", accept_licence=True, host=host)
    fetched, known = Scene.load(path), Scene.load(lhdl_hip / "scene.toml")
    assert set(fetched.muscles) == set(known.muscles)
    for name in ("gluteus_maximus", "gluteus_medius", "iliacus"):
        for one, other in zip(
            fetched.muscles[name].attachments, known.muscles[name].attachments, strict=True
        ):
            assert (one.role, one.bone, one.closed) == (other.role, other.bone, other.closed)
            np.testing.assert_allclose(one.landmarks, other.landmarks, atol=2e-3)
        np.testing.assert_array_equal(
            points_of(fetched.muscles[name].surface), points_of(known.muscles[name].surface)
        )
    assert {one.role for one in fetched.muscles["adductor_brevis"].attachments} == {"origin", "insertion"}
    for bone in ("pelvis", "femur_r"):
        assert fetched.bones[bone].GetNumberOfPolys() == known.bones[bone].GetNumberOfPolys()
    moved, as_known = (scene.motion.transforms["femur_r"] for scene in (fetched, known))
    np.testing.assert_allclose(moved, as_known[:45], atol=0.01)  # the rest pose: to a thousandth of a degree


@pytest.mark.realdata
def test_the_checksum_of_the_model_is_that_of_the_file(lhdl_hip):
    name = "LHDL_hip_r.osim"
    assert hashlib.sha256((lhdl_hip / "reference" / name).read_bytes()).hexdigest() == FILES[name][1]


def test_files_are_pinned():
    assert all(re.fullmatch("[^/]+/[^/]+/[0-9a-f]{40}/.+", path) for path, _ in FILES.values())
