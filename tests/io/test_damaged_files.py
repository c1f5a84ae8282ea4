"""A damaged file is a result or one clear error, never the end of the process."""

import re
import sys
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from vtkmodules.util.vtkConstants import VTK_DOUBLE
from vtkmodules.vtkIOGeometry import vtkOBJWriter, vtkSTLWriter
from vtkmodules.vtkIOLegacy import vtkPolyDataWriter
from vtkmodules.vtkIOPLY import vtkPLYWriter
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from mutations import mutated, read_all
from tiny_scene import ellipsoid

from vtkmuscle.data.arrays import add_arrays, field_string, points_of, triangles_of
from vtkmuscle.io import in_child, read_polydata

TRIANGLE = """ply
format ascii 1.0
element vertex {vertices}
property float x
property float y
property float z
element face {faces}
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
{face}
"""


def surface():
    data = ellipsoid((8, 8, 40), (0, 0, 0), 8)
    add_arrays(data, points={"Height": points_of(data)[:, 2]}, fields={"Scene": "a name"})
    return data


def write(folder, kind):
    """Write a surface; kind is a suffix and, after a dash, how."""
    suffix, _, how = kind.partition("-")
    path = folder / f"{how or 'plain'}.{suffix}"
    writers = {"ply": vtkPLYWriter, "vtk": vtkPolyDataWriter, "stl": vtkSTLWriter, "obj": vtkOBJWriter}
    writer = writers.get(suffix, vtkXMLPolyDataWriter)()
    writer.SetInputData(surface())
    writer.SetFileName(str(path))
    if suffix == "vtp":
        data, _, packed = how.partition(" ")
        {"ascii": writer.SetDataModeToAscii, "binary": writer.SetDataModeToBinary}.get(
            data, writer.SetDataModeToAppended
        )()
        writer.SetEncodeAppendedData(data == "base64")
        {"zlib": writer.SetCompressorTypeToZLib, "lzma": writer.SetCompressorTypeToLZMA}.get(
            packed, {"lz4": writer.SetCompressorTypeToLZ4}.get(packed, writer.SetCompressorTypeToNone)
        )()
    elif suffix != "obj":
        writer.SetFileType(2 if how == "binary" else 1)
    writer.Write()
    return path


KINDS = [f"{suffix}-{how}" for suffix in ("ply", "vtk", "stl") for how in ("ascii", "binary")]
KINDS += ["obj", "vtp-ascii", "vtp-raw none", "vtp-raw zlib", "vtp-base64 lz4", "vtp-binary lzma"]


@pytest.mark.parametrize("kind", KINDS)
def test_whole_files_of_every_kind_are_read(tmp_path, kind):
    expected, found = surface(), read_polydata(write(tmp_path, kind))
    assert found.GetPoints().GetDataType() == VTK_DOUBLE
    assert found.GetNumberOfPolys() == expected.GetNumberOfPolys()
    assert np.allclose(*[points_of(data)[triangles_of(data, "")] for data in (found, expected)], atol=1e-4)
    if kind.startswith("vtp"):
        assert np.allclose(
            found.GetPointData().GetArray("Height"), expected.GetPointData().GetArray("Height")
        )


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"face": "3 0 1 999999"}, "damaged"),
        ({"face": "-3 0 1 2"}, "damaged"),
        ({"face": "3 0 1 -1"}, "names point -1"),
        ({"face": "255 0 1 2"}, "requires 265 numbers, but the file has 13"),
        ({"face": "2 0 1"}, "has 2 corners"),
        ({"face": "3 0 1 two"}, "a word in place of a number"),
        ({"vertices": "1000000000000"}, "damaged"),
        ({"faces": "2"}, "has 0 corners"),
    ],
    ids=str,
)
def test_a_ply_file_that_says_what_is_not_so_is_refused(tmp_path, change, words):
    (tmp_path / "a.ply").write_text(
        TRIANGLE.format(**({"vertices": 3, "faces": 1, "face": "3 0 1 2"} | change))
    )
    with pytest.raises(ValueError, match=words) as failure:
        read_polydata(tmp_path / "a.ply")
    assert len(str(failure.value).splitlines()) == 1


@pytest.mark.parametrize("kind", ["ply-ascii", "ply-binary", "vtp-ascii", "vtp-raw zlib"])
def test_a_file_that_is_cut_off_is_refused(tmp_path, kind):
    path = write(tmp_path, kind)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(ValueError, match="export it again"):
        read_polydata(path)


@pytest.mark.parametrize("change", ["NumberOfPoints=-1", "NumberOfPolys=2147483647", "offset=2147483647"])
def test_a_vtp_file_that_says_more_than_it_holds_is_refused(tmp_path, change):
    path = write(tmp_path, "vtp-raw zlib")
    name, value = change.encode().split(b"=")
    path.write_bytes(re.sub(name + rb'="\d+"', name + b'="' + value + b'"', path.read_bytes(), count=1))
    with pytest.raises(ValueError, match=r"\.vtp: .*export it again"):
        read_polydata(path)


def test_entities_are_not_read_and_bombs_are_refused(tmp_path):
    path = write(tmp_path, "vtp-raw zlib")
    content = path.read_bytes()
    secret = tmp_path / "secret"
    secret.write_text("read")
    entity = f'<!DOCTYPE a [<!ENTITY b SYSTEM "{secret.as_uri()}">]>\n'.encode()
    text = content.replace(b"<VTKFile", entity + b"<VTKFile", 1)
    name = b'Name="Height"'
    assert name in text
    path.write_bytes(text.replace(name, b'Name="Height&b;"', 1))
    with pytest.raises(ValueError, match="export it again"):
        read_polydata(path)
    start = content.index(b"_", content.index(b"<AppendedData")) + 1
    last = (2**31 - 1).to_bytes(4, "little")  # what the last block is said to unpack to
    path.write_bytes(content[: start + 8] + last + content[start + 12 :])
    with pytest.raises(ValueError, match="takes too much memory"):
        read_polydata(path)


def test_a_file_that_is_not_read_in_time_is_refused_and_the_next_one_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(in_child, "LONGEST", 0.5)
    endless = tmp_path / "a.vtk"  # VTK asks for each of the texts, beyond the end of the file
    head = b"# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\n"
    endless.write_bytes(head + b"FIELD F 1\nR 1 2147483647 string\nabc\n")
    with pytest.raises(ValueError, match=r"a\.vtk: .*(not read within|too much memory)"):
        read_polydata(endless)
    monkeypatch.undo()
    assert read_polydata(write(tmp_path, "vtk-ascii")).GetNumberOfPolys()
    monkeypatch.setattr(Path, "stat", Mock(return_value=Path(__file__).stat()))  # the file is lost after it
    with pytest.raises(ValueError, match=r"the file cannot be read as \.vtp"):
        in_child.read_in_child(tmp_path / "lost.vtp", "vtkmodules.vtkIOXML", "vtkXMLPolyDataReader")


def test_what_is_read_in_another_process_has_all_its_arrays(tmp_path):
    data = surface()
    add_arrays(data, fields={"Ähnlich <&>": 'a "name"\nof two lines'})
    writer = vtkPolyDataWriter()
    writer.SetInputData(data)
    writer.SetFileName(str(tmp_path / "a.vtk"))
    writer.SetFileTypeToBinary()
    writer.Write()
    found = read_polydata(tmp_path / "a.vtk")
    assert field_string(found, "Ähnlich <&>") == 'a "name"\nof two lines'
    np.testing.assert_array_equal(points_of(found), points_of(data))


@pytest.mark.slow
def test_mutated_meshes_are_a_result_or_one_clear_error(tmp_path, tried):
    paths = []
    for kind in KINDS:
        whole = write(tmp_path, kind)
        for number in range(60):
            paths.append(whole.with_stem(f"{whole.stem}_{number}"))
            paths[-1].write_bytes(mutated(whole.read_bytes(), 1000 + number))
    results = read_all(paths, "vtkmuscle.io", "read_polydata")
    for path, (what, words, seconds) in results.items():
        assert what in ("read", "refused"), (path, words)
        assert len(words.splitlines()) <= 1
        assert seconds < 60.0
        tried.add(f"a damaged {Path(path).suffix}, read", "used" if what == "read" else "refused")
    refused = sum(what == "refused" for what, _, _ in results.values())
    assert len(paths) // 20 < refused < 19 * len(paths) // 20


def test_a_reading_process_that_has_died_is_said_with_its_status(tmp_path, monkeypatch):
    """The question to a dead process was a broken pipe."""
    child = in_child._child
    process = child._running()
    process.kill()
    process.wait()
    monkeypatch.setattr(child, "_running", lambda: process)
    with pytest.raises(ValueError, match="ended with SIGKILL"):
        read_polydata(write(tmp_path, "vtp"))
