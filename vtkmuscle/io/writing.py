"""Write files beside their place and move them in when they are complete."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a name beside a file to write to, and move what was written into place at the end.

    Whoever reads the file sees the old content or the new one, never a part. Where writing fails the
    old file stays, and nothing is left beside it.

    Parameters
    ----------
    path : Path
        The file to be written; its folder is made.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        yield beside
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text file (UTF-8), all or nothing."""
    with replacing(path) as beside:
        beside.write_text(text, encoding="utf-8", newline="\n")


def write_polydata(path: Path, data: vtkPolyData) -> None:
    """Write a .vtp file, all or nothing: binary, compressed without loss, doubles kept exact.

    Parameters
    ----------
    path : Path
        Where to; replaced where it exists.
    data : vtkPolyData
        What to write.

    Raises
    ------
    OSError
        If VTK could not write the file (disk full, no permission).
    """
    writer = vtkXMLPolyDataWriter()
    writer.SetInputData(data)
    writer.SetDataModeToAppended()
    writer.EncodeAppendedDataOff()
    writer.SetHeaderTypeToUInt64()
    writer.SetCompressorTypeToZLib()
    with replacing(path) as beside:
        beside.touch()  # Python says better than VTK why a file cannot be written
        writer.SetFileName(str(beside))
        if not writer.Write() or writer.GetErrorCode():
            raise OSError(f"{path}: the file could not be written; is the disk full?")
