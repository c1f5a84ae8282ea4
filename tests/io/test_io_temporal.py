"""Time series come back from .pvd files as they went in, field data and all."""

import re
from pathlib import Path

import numpy as np
import pytest
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

from vtkmuscle.data.arrays import (
    add_arrays,
    blocks_of,
    cell_array,
    field_array,
    field_string,
    point_array,
    points_of,
    surface_from,
)
from vtkmuscle.io import Collection, Series, read_series, write_polydata, writing

TIMES = (0.0, 2.5, 5.0)


def frame(i):
    surface = surface_from(np.eye(3) * (i + 1) / 3.0, np.array([[0, 1, 2]]))
    add_arrays(
        surface,
        points={"Velocity": np.arange(9.0).reshape(3, 3) / 7.0 * i},
        cells={"Colour": np.array([i])},
        fields={"VolumeRatio": 1.0 + i / 3.0, "Transform": np.arange(16.0) * i, "Units": "mm"},
    )
    return surface


def write(folder):
    series = Series(folder, "m")
    for i, time in enumerate(TIMES):
        series.add(i, time, frame(i))
    return folder / "m.pvd"


def test_a_series_is_read_back_exactly(tmp_path):
    series = read_series(write(tmp_path))
    assert series.times == TIMES
    for i in (2, 0, 1):
        expected, found = frame(i), series.frame(i)
        assert np.array_equal(points_of(found), points_of(expected))
        assert np.array_equal(point_array(found, "Velocity", ""), point_array(expected, "Velocity", ""))
        assert cell_array(found, "Colour", "").tolist() == [i]
        assert field_array(found, "VolumeRatio").tolist() == [1.0 + i / 3.0]
        assert field_array(found, "Transform").tolist() == (np.arange(16.0) * i).tolist()
        assert field_string(found, "Units") == "mm"
    assert np.array_equal(points_of(series.at(2.0)), points_of(frame(1)))


def test_parts_of_a_step_are_blocks(tmp_path):
    write_polydata(tmp_path / "a.vtp", frame(0))
    write_polydata(tmp_path / "b.vtp", frame(1))
    Collection(tmp_path / "ab.pvd").add(1.0, {"a": tmp_path / "a.vtp", "b": tmp_path / "b.vtp"})
    blocks = blocks_of(read_series(tmp_path / "ab.pvd").frame(0))
    assert [name for name, _ in blocks] == ["a", "b"]
    assert np.array_equal(points_of(blocks[1][1]), points_of(frame(1)))


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("m.pvd", "<VTKFile><Collection/></VTKFile>", "lists no time step"),
        ("m.pvd", "no xml", "the file is not XML"),
        ("m.pvd", "<VTKFile/>", "has no Collection"),
        ("m.pvd", "<VTKFile><Collection><DataSet/></Collection></VTKFile>", "no ParaView collection"),
        ("m.vtp", "", "must be a .pvd file"),
    ],
)
def test_files_that_are_no_series_are_named(tmp_path, name, content, words):
    (tmp_path / name).write_text(content)
    with pytest.raises(ValueError, match=re.escape(words)) as caught:
        read_series(tmp_path / name)
    assert str(tmp_path / name) in str(caught.value)


def test_a_fault_in_a_frame_leaves_the_finished_ones_and_no_part(tmp_path, monkeypatch):
    series = Series(tmp_path, "m")
    series.add(0, 0.0, frame(0))

    class HalfWriter(vtkXMLPolyDataWriter):
        def Write(self):
            Path(self.GetFileName()).write_bytes(b"<VTKFile half")
            return 0

    monkeypatch.setattr(writing, "vtkXMLPolyDataWriter", HalfWriter)
    with pytest.raises(OSError, match=r"m_0001\.vtp: the file could not be written"):
        series.add(1, 1.0, frame(1))
    monkeypatch.undo()
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["m", "m.pvd", "m_0000.vtp"]
    assert read_series(tmp_path / "m.pvd").times == (0.0,)
