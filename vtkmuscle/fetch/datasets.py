"""What is known of a public data set: its licence, its files, and how to know them again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.surface import survey
from vtkmuscle.data.arrays import points_of, triangles_of

#: How far figures of a surface may be from those that are known: they are printed with few digits, and
#: repeated points may be counted or not.
RELATIVE_TOLERANCE = 1e-3
BOUNDS_TOLERANCE = 0.05


@dataclass(frozen=True)
class SurfaceFigures:
    """What is known of a surface whose file's checksum is not.

    Attributes
    ----------
    triangles : int
        Their number, within 0.1 %.
    volume : float
        Within 0.1 % [mm^3].
    bounds : tuple of float
        Least and greatest x, y and z, within 0.05 [mm].
    """

    triangles: int
    volume: float
    bounds: tuple[float, float, float, float, float, float]

    def check(self, surface: vtkPolyData, where: str) -> None:
        """Raise an InputError where a surface is another one."""
        points = points_of(surface)
        report = survey(points, triangles_of(surface, where))
        bounds = np.column_stack([points.min(axis=0), points.max(axis=0)]).ravel()
        wrong = [
            f"{name} {has:.6g}, not {asked:.6g}"
            for name, has, asked in (
                ("triangles", report.n_triangles, self.triangles),
                ("volume", abs(report.volume), self.volume),
            )
            if abs(has - asked) > RELATIVE_TOLERANCE * asked
        ]
        if np.abs(bounds - self.bounds).max() > BOUNDS_TOLERANCE:
            wrong.append(f"bounds {bounds.round(2).tolist()}, not {list(self.bounds)}")
        if wrong:
            raise InputError(where, f"this is not the published surface: {'; '.join(wrong)}", AGAIN)


#: What to do about a file that is not the one that it should be.
AGAIN = "try again; if it stays so, what is published has changed, or something on the way changes it"


@dataclass(frozen=True)
class RemoteFile:
    """A file in a public repository.

    Attributes
    ----------
    name : str
        What it is called while the scene is put together; its suffix says what it is.
    repository : str
        ``"owner/name"``.
    commit : str
        40 digits: what is published there later is not taken.
    path : str
        In the repository.
    sha256 : str
        Of the file, 64 digits; "" where it is not known: then what is read is checked.
    """

    name: str
    repository: str
    commit: str
    path: str
    sha256: str = ""

    def url(self, host: str) -> str:
        """Return where it is, at a host that serves raw files as GitHub does."""
        return f"{host.rstrip('/')}/{self.repository}/{self.commit}/{self.path}"


@dataclass(frozen=True)
class DataSet:
    """A public data set.

    Attributes
    ----------
    title : str
        A line.
    licence : str
        What the user accepts: whose the data are, what may be done with them, whom to name.
    files : tuple of RemoteFile
        What is downloaded.
    build : callable
        Writes the scene: called with the downloaded files, by name, and an empty folder; returns the
        scene.toml. It checks what it reads of files without a known checksum.
    """

    title: str
    licence: str
    files: tuple[RemoteFile, ...]
    build: Callable[[Mapping[str, Path], Path], Path]
