"""A series on disk is complete after every frame, whatever happens in the next."""

from pathlib import Path

import numpy as np
import pytest
import pyvista
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

from vtkmuscle.data.arrays import points_of, surface_from
from vtkmuscle.io import Series, write_text, writing

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


def test_text_is_written_whole_with_its_folders(tmp_path):
    write_text(tmp_path / "a/b/c.csv", "x\nü\n")
    assert (tmp_path / "a/b/c.csv").read_bytes() == "x\nü\n".encode()
    assert [p.name for p in (tmp_path / "a/b").iterdir()] == ["c.csv"]
