"""Time series on disk: a .pvd file that lists .vtp files, complete after every frame."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.io.writing import write_polydata, write_text


class Collection:
    """A ParaView collection (.pvd) that grows by one time step at a time.

    It is written anew after each step, so that a run that is stopped leaves a file that lists all steps
    that were finished, and only those.

    Parameters
    ----------
    path : Path
        The .pvd file; replaced by the first step where it exists.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._entries: list[str] = []

    def add(self, time: float, parts: Mapping[str, Path]) -> None:
        """Add a time step.

        Parameters
        ----------
        time : float
            Pipeline time.
        parts : mapping of str to Path
            Files that make up the step, by name; they exist already, in or below the folder of the .pvd.
        """
        for number, (name, file) in enumerate(parts.items()):
            relative = file.relative_to(self.path.parent).as_posix()
            self._entries.append(
                f'    <DataSet timestep="{float(time)!r}" part="{number}" name={quoteattr(name)} '
                f"file={quoteattr(relative)}/>"
            )
        lines = [
            '<?xml version="1.0"?>',
            '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">',
            "  <Collection>",
            *self._entries,
            "  </Collection>",
            "</VTKFile>",
        ]
        write_text(self.path, "\n".join(lines) + "\n")


class Series:
    """Poly data over time: ``NAME.pvd`` and ``NAME/NAME_0000.vtp`` and so on.

    Parameters
    ----------
    folder : Path
        Where to.
    name : str
        Name of the .pvd and of the folder of its frames.

    Attributes
    ----------
    files : list of Path
        The .pvd, and what it lists.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self.name = name
        self.frames = folder / name
        self.collection = Collection(folder / f"{name}.pvd")
        self.files = [self.collection.path]

    def add(self, frame: int, time: float, data: vtkPolyData) -> None:
        """Write a frame, then list it.

        Parameters
        ----------
        frame : int
            Number of the frame, for the file's name.
        time : float
            Pipeline time.
        data : vtkPolyData
            What to write.
        """
        path = self.frames / f"{self.name}_{frame:04d}.vtp"
        write_polydata(path, data)
        self.collection.add(time, {self.name: path})
        self.files.append(path)
