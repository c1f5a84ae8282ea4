"""Time series come back from .pvd files as they went in, field data and all."""

import os
from pathlib import Path

import numpy as np
import pytest
import pyvista
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

from vtkmuscle.data import arrays
from vtkmuscle.io import Series, write_polydata, writing
from vtkmuscle.io.surfaces import steps_in

TIMES = (0.0, 2.5, 5.0)


def frame(i):
    surface = arrays.surface_from(np.eye(3) * (i + 1) / 3.0, np.array([[0, 1, 2]]))
    arrays.add_arrays(
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
    reader = pyvista.get_reader(write(tmp_path))
    assert reader.time_values == list(TIMES)
    for i in (2, 0, 1):
        reader.set_active_time_point(i)
        expected, found = frame(i), reader.read()[0]
        assert np.array_equal(arrays.points_of(found), arrays.points_of(expected))
        assert np.array_equal(
            arrays.point_array(found, "Velocity", ""), arrays.point_array(expected, "Velocity", "")
        )
        assert arrays.cell_array(found, "Colour", "").tolist() == [i]
        assert arrays.field_array(found, "VolumeRatio").tolist() == [1.0 + i / 3.0]
        assert arrays.field_array(found, "Transform").ravel().tolist() == (np.arange(16.0) * i).tolist()
        assert arrays.field_string(found, "Units") == "mm"


def test_parts_of_a_step_are_blocks(tmp_path):
    write_polydata(tmp_path / "a.vtp", frame(0))
    write_polydata(tmp_path / "b.vtp", frame(1))
    Series(tmp_path, "ab").add_parts(1.0, {"a": tmp_path / "a.vtp", "b": tmp_path / "b.vtp"})
    blocks = pyvista.get_reader(tmp_path / "ab.pvd").read()
    assert len(blocks) == 2
    assert np.array_equal(arrays.points_of(blocks[1]), arrays.points_of(frame(1)))
    assert steps_in(tmp_path / "ab.pvd") == 1


@pytest.mark.skipif(os.name != "posix", reason="Windows has no limit on files")
def test_a_full_disk_leaves_the_collection_as_it_was(tmp_path):
    import resource

    series = Series(tmp_path, "m")
    series.add(0, 0.0, frame(0))
    before, limits = series.path.read_bytes(), resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) + 10, limits[1]))
    try:
        with pytest.raises(OSError, match="No space left"):
            series.add_parts(1.0, {"m": tmp_path / "m" / "m_0000.vtp"})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert series.path.read_bytes() == before
    series.add(1, 1.0, frame(1))
    assert steps_in(series.path) == 2


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
    assert steps_in(tmp_path / "m.pvd") == 1
