"""Time series on disk: .pvd with .vtp files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from html import escape  # that of xml.sax would load an HTTP client
from os import PathLike
from pathlib import Path
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError, check_is_file
from vtkmuscle.data.arrays import multiblock_from
from vtkmuscle.io.surfaces import read_polydata
from vtkmuscle.io.writing import write_polydata, write_text
from vtkmuscle.io.xml_elements import read_xml


class Collection:
    """A ParaView collection (.pvd) that grows step by step.

    Each step rewrites the file, so that an interrupted run leaves a list of exactly the finished steps. The
    first step replaces an existing file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._entries: list[str] = []

    def add(self, time: float, parts: Mapping[str, Path]) -> None:
        """Add existing files of a time step by name, in or below the folder of the .pvd."""
        for number, (name, file) in enumerate(parts.items()):
            relative = file.relative_to(self.path.parent).as_posix()
            names = f'part="{number}" name="{escape(name)}" file="{escape(relative)}"'
            self._entries.append(f'    <DataSet timestep="{float(time)!r}" {names}/>\n')
        head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n'
        entries = "".join(self._entries)
        write_text(self.path, f"{head}  <Collection>\n{entries}  </Collection>\n</VTKFile>\n")


class Series:
    """Poly data over time: ``NAME.pvd`` and ``NAME/NAME_0000.vtp``."""

    def __init__(self, folder: Path, name: str) -> None:
        self.name, self.frames = name, folder / name
        self.collection = Collection(folder / f"{name}.pvd")

    def add(self, frame: int, time: float, data: vtkPolyData) -> Path:
        """Write and list the data of a frame; return the file."""
        path = self.frames / f"{self.name}_{frame:04d}.vtp"
        write_polydata(path, data)
        self.collection.add(time, {self.name: path})
        return path


@dataclass(frozen=True)
class TimeSeries:
    """Frames in files, read on demand, at ascending pipeline times.

    ``frame`` returns the vtkPolyData of a frame number, or a vtkMultiBlockDataSet of named parts.
    """

    times: tuple[float, ...]
    frame: Callable[[int], Any]
    files: tuple[Path, ...]

    def at(self, time: float) -> Any:
        """Return the frame nearest to a time."""
        return self.frame(min(range(len(self.times)), key=lambda number: abs(self.times[number] - time)))


def read_series(path: str | PathLike[str]) -> TimeSeries:
    """Open a time series from a .pvd file.

    Raises
    ------
    FileNotFoundError, ValueError
        If the file does not exist, is no time series, or cannot be read.
    """
    path = Path(path)
    if path.suffix.lower() != ".pvd":
        raise InputError(path, "a time series must be a .pvd file")
    check_is_file(path)
    steps: dict[float, dict[str, Path]] = {}
    for entry in read_xml(path).need("Collection").children:
        try:
            parts = steps.setdefault(float(entry.attributes.get("timestep", "0")), {})
            name = entry.name or entry.attributes.get("part") or str(len(parts))
            parts[name] = path.parent / entry.attributes["file"]
        except (KeyError, ValueError) as error:
            raise entry.error(f"the file is no ParaView collection: {error}", "write it again") from error
    if not steps:
        raise InputError(path, "the collection lists no time step")
    times = tuple(sorted(steps))

    def frame(number: int) -> Any:
        parts = {name: read_polydata(file) for name, file in steps[times[number]].items()}
        return next(iter(parts.values())) if len(parts) == 1 else multiblock_from(parts)

    files = dict.fromkeys(file for parts in steps.values() for file in parts.values())
    return TimeSeries(times, frame, tuple(files))
