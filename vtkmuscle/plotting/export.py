"""Scenes for web pages: glTF files of bones, muscles and fibres in a pose."""

from __future__ import annotations

import json
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkAppendPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.io.child_reader import vtk_messages
from vtkmuscle.io.writing import replacing
from vtkmuscle.plotting.surfaces import make_plotter
from vtkmuscle.plotting.views import choose_view


def export_scene(
    path: str | PathLike[str],
    bones: vtkMultiBlockDataSet,
    muscles: Sequence[vtkPolyData],
    *,
    fibres: Sequence[vtkPolyData] = (),
) -> None:
    """Write a pose as one glTF file, with ivory bones, translucent red muscles and fibres as tubes.

    Parameters
    ----------
    path : path
        A .gltf file, with all its data in it; replaced where it exists. Viewers such as ``<model-viewer>`` or
        three.js show it on a web page.
    bones : vtkMultiBlockDataSet
        Named blocks of triangles.
    muscles : sequence of vtkPolyData
        Closed surfaces, oriented outward.
    fibres : sequence of vtkPolyData, optional
        Polylines.

    Raises
    ------
    ValueError
        For another suffix.
    OSError
        If the file could not be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".gltf":
        fix = "give it that suffix; a run writes report.html by itself"
        raise InputError(path, "a scene is exported to a .gltf file", fix)
    from vtkmodules.vtkIOExport import vtkGLTFExporter  # noqa: PLC0415 -- an export alone needs it

    view = choose_view(list(muscles), [bones] * len(muscles))
    plotter = make_plotter(bones, muscles, view, fibres=_appended(fibres) if fibres else None)
    try:
        with replacing(path) as beside:
            exporter = vtkGLTFExporter()
            exporter.SetRenderWindow(plotter.render_window)
            exporter.SetInlineData(True)
            exporter.SetSaveNormal(True)
            exporter.SetFileName(str(beside))
            with vtk_messages():
                exporter.Write()
            if not _is_whole(beside):
                raise OSError(f"{path}: the file could not be written; is the disk full?")
    finally:
        plotter.close()


def _is_whole(path: Path) -> bool:
    """Return whether a file is JSON to its end: VTK does not say that it could not write it."""
    try:
        json.loads(path.read_bytes())
    except ValueError:
        return False
    return True


def _appended(fibres: Sequence[vtkPolyData]) -> vtkPolyData:
    append = vtkAppendPolyData()
    append.SetOutputPointsPrecision(vtkAppendPolyData.DOUBLE_PRECISION)
    for lines in fibres:
        append.AddInputData(lines)
    append.Update()
    result: vtkPolyData = append.GetOutput()
    return result
