"""A series on disk is complete after every frame, whatever happens in the next."""

from pathlib import Path

import numpy as np
import pytest
import pyvista
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

from vtkmuscle.data.arrays import points_of, surface_from
from vtkmuscle.io import Collection, Series, read_surface, write_polydata, write_text, writing

TRIANGLE = np.array([[0, 1, 2]])


def frame(i):
    return surface_from(np.eye(3) * (i + 1) / 3.0, TRIANGLE)


def test_paraview_reads_every_step_with_its_time(tmp_path):
    series = Series(tmp_path, "iliacus & co")
    for i in range(3):
        series.add(i + 5, 2.5 * i, frame(i))
        reader = pyvista.get_reader(tmp_path / "iliacus & co.pvd")
        assert reader.time_values == [2.5 * j for j in range(i + 1)]
    reader.set_active_time_value(2.5)
    np.testing.assert_array_equal(reader.read()[0].points, points_of(frame(1)))
    assert (tmp_path / "iliacus & co" / "iliacus & co_0007.vtp").is_file()


def test_several_parts_of_a_step_may_be_shared_by_steps(tmp_path):
    still, moving = tmp_path / "bones/a.vtp", [tmp_path / f"bones/b_{i}.vtp" for i in range(2)]
    write_polydata(still, frame(0))
    collection = Collection(tmp_path / "bones.pvd")
    for i in range(2):
        write_polydata(moving[i], frame(i))
        collection.add(i, {"a": still, "b": moving[i]})
    reader = pyvista.get_reader(tmp_path / "bones.pvd")
    reader.set_active_time_value(1.0)
    first, second = reader.read()
    np.testing.assert_array_equal(first.points, points_of(frame(0)))
    np.testing.assert_array_equal(second.points, points_of(frame(1)))


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
    assert pyvista.get_reader(tmp_path / "m.pvd").time_values == [0.0]


def test_a_fault_in_writing_keeps_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "m.vtp"
    write_polydata(path, frame(0))

    class FailingWriter(vtkXMLPolyDataWriter):
        def Write(self):
            raise MemoryError

    monkeypatch.setattr(writing, "vtkXMLPolyDataWriter", FailingWriter)
    with pytest.raises(MemoryError):
        write_polydata(path, frame(1))
    monkeypatch.undo()
    np.testing.assert_array_equal(points_of(read_surface(path)), points_of(frame(0)))
    assert [p.name for p in tmp_path.iterdir()] == ["m.vtp"]


def test_a_new_series_forgets_the_steps_of_an_earlier_one(tmp_path):
    for i in range(3):
        Series(tmp_path, "m").add(i, float(i), frame(i))
    assert pyvista.get_reader(tmp_path / "m.pvd").time_values == [2.0]


def test_text_is_written_whole_with_its_folders(tmp_path):
    write_text(tmp_path / "a/b/c.csv", "x\nü\n")
    assert (tmp_path / "a/b/c.csv").read_bytes() == "x\nü\n".encode()
    assert [p.name for p in (tmp_path / "a/b").iterdir()] == ["c.csv"]
