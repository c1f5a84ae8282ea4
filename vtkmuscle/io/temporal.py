"""Time series on disk: .pvd with .vtp files, or .vtkhdf."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape  # that of xml.sax would load an HTTP client
from os import PathLike
from pathlib import Path
from threading import Lock
from typing import Any

from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

from vtkmuscle.core.errors import InputError, check_is_file
from vtkmuscle.data.arrays import array_names, multiblock_from
from vtkmuscle.data.pipeline_times import announce_times, times_of
from vtkmuscle.io.in_child import check_in_child, vtk_messages
from vtkmuscle.io.surfaces import read_polydata
from vtkmuscle.io.writing import replacing, write_polydata, write_text
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
        self.name = name
        self.frames = folder / name
        self.collection = Collection(folder / f"{name}.pvd")

    def add(self, frame: int, time: float, data: vtkPolyData) -> Path:
        """Write and list the data of a frame; return the file."""
        path = self.frames / f"{self.name}_{frame:04d}.vtp"
        write_polydata(path, data)
        self.collection.add(time, {self.name: path})
        return path


#: Suffixes of files for :func:`read_series`.
SERIES_SUFFIXES = (".pvd", ".vtkhdf")

#: First bytes of an HDF5 file.
_HDF = b"\x89HDF\r\n\x1a\n"

#: Values per chunk, since VTK's 25 000 inflate a file of many small arrays; and compression level.
_CHUNK, _COMPRESSION = 1000, 4

#: Disk space reserved for a file, relative to its uncompressed content, plus a constant [bytes].
_ROOM = 1.2
_LEAST_ROOM = 2_000_000

#: HDF5 is not thread-safe.
_one_writer = Lock()


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
    """Open a time series from a .pvd or .vtkhdf file.

    Raises
    ------
    FileNotFoundError, ValueError
        If the file does not exist, is no time series, or cannot be read.
    """
    path = Path(path)
    if path.suffix.lower() not in SERIES_SUFFIXES:
        raise InputError(path, f"a time series must be a {' or '.join(SERIES_SUFFIXES)} file")
    check_is_file(path)
    return _from_pvd(path) if path.suffix.lower() == ".pvd" else _from_vtkhdf(path)


def write_vtkhdf(
    path: str | PathLike[str], times: Sequence[float], frame: Callable[[int], vtkPolyData]
) -> None:
    """Write poly data over time as a temporal VTKHDF file.

    A failed write leaves no file.

    Parameters
    ----------
    path : path
        The .vtkhdf file; replaced if existing.
    times : sequence of float
        Ascending.
    frame : callable
        Returns the vtkPolyData of a frame number. Only arrays of all frames are written, because VTK's
        reader gives all frames the same arrays.

    Raises
    ------
    OSError
        If VTK could not write the file.
    """
    from vtkmodules.vtkIOHDF import vtkHDFWriter  # noqa: PLC0415 -- not in the VTK of ParaView 5.11

    path = Path(path)
    source = _Frames(tuple(float(time) for time in times), frame)
    path.parent.mkdir(parents=True, exist_ok=True)
    writer = vtkHDFWriter()
    writer.SetInputConnection(source.GetOutputPort())
    writer.SetWriteAllTimeSteps(True)
    writer.SetChunkSize(_CHUNK)
    writer.SetCompressionLevel(_COMPRESSION)
    with _one_writer, replacing(path) as partial:
        _check_room(path, partial, source.nbytes)
        writer.SetFileName(str(partial))
        with vtk_messages():
            written = writer.Write()
        if source.error is not None:
            raise source.error
        if not written or writer.GetErrorCode():
            raise OSError(f"{path}: the file could not be written; is the disk full?")


def _check_room(path: Path, partial: Path, nbytes: int) -> None:
    """Raise an OSError if HDF5 would exceed the disk.

    The space is reserved and released, so that quotas and limits count, too.
    """
    needed = int(_ROOM * nbytes) + _LEAST_ROOM
    try:
        if hasattr(os, "posix_fallocate"):
            with partial.open("r+b") as file:
                os.posix_fallocate(file.fileno(), 0, needed)
                file.truncate(0)
        elif needed > shutil.disk_usage(path.parent).free:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    except OSError as error:
        words = f"{error.strerror}: the file may take {needed / 1e6:.1f} MB"
        raise OSError(error.errno, words, str(path)) from error


class _Frames(VTKPythonAlgorithmBase):
    """A source of frames that announces times."""

    def __init__(self, times: tuple[float, ...], frame: Callable[[int], vtkPolyData]) -> None:
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkPolyData")
        self._times, self._frame = times, frame
        self.error: Exception | None = None
        parts = [(_arrays(data), int(data.GetActualMemorySize())) for data in map(frame, range(len(times)))]
        self._common = set.intersection(*(arrays for arrays, _ in parts))
        #: Memory of all frames [bytes].
        self.nbytes = 1024 * sum(size for _, size in parts)

    def RequestInformation(self, request: Any, inInfo: Any, outInfo: Any) -> int:  # noqa: N802, N803
        announce_times(outInfo.GetInformationObject(0), self._times)
        return 1

    def RequestData(self, request: Any, inInfo: Any, outInfo: Any) -> int:  # noqa: N802, N803
        info = outInfo.GetInformationObject(0)
        key = vtkStreamingDemandDrivenPipeline.UPDATE_TIME_STEP()
        time = info.Get(key) if info.Has(key) else self._times[0]
        try:
            frame = self._frame(self._times.index(time))
        except Exception as error:  # write_vtkhdf raises the error again; VTK would only print the error
            self.error = error
            return 0
        output = vtkPolyData.GetData(outInfo)
        output.ShallowCopy(frame)
        for kind, name in _arrays(frame) - self._common:
            getattr(output, kind)().RemoveArray(name)
        output.GetInformation().Set(output.DATA_TIME_STEP(), time)
        return 1


def _arrays(data: vtkPolyData) -> set[tuple[str, str]]:
    kinds = ("GetPointData", "GetCellData", "GetFieldData")
    return {(kind, name) for kind in kinds for name in array_names(getattr(data, kind)())}


def _from_pvd(path: Path) -> TimeSeries:
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


def _from_vtkhdf(path: Path) -> TimeSeries:
    with path.open("rb") as file:
        if file.read(len(_HDF)) != _HDF:
            raise InputError(path, "the file is no VTKHDF file", "write it again")
    check_in_child(path, "vtkmodules.vtkIOHDF", "vtkHDFReader")
    from vtkmodules.vtkIOHDF import vtkHDFReader  # noqa: PLC0415 -- not needed to write .pvd

    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    if not reader.CanReadFile(str(path)):
        raise InputError(path, "the file is no VTKHDF file", "write it again")
    reader.UpdateInformation()
    times = times_of(reader.GetOutputInformation(0)) or (0.0,)

    def frame(number: int) -> Any:
        reader.UpdateTimeStep(times[number])
        data = reader.GetOutputDataObject(0)
        if not isinstance(data, vtkPolyData | vtkMultiBlockDataSet):
            raise InputError(path, f"the file holds a {data.GetClassName()}, not poly data")
        copy = data.NewInstance()
        copy.DeepCopy(data)
        copy.GetFieldData().RemoveArray("Time")  # the reader's own
        return copy

    return TimeSeries(times, frame, (path,))
