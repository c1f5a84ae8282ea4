"""The test problem of the solver's benchmarks: a muscle held at both ends, one of which is turned."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

from vtkmuscle.core.mesh.harmonic import harmonic_weights
from vtkmuscle.core.motion.blending import blend_motions

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Part of the points that is fixed at each end.
FIXED_PART = 0.05


def data_folder() -> Path:
    """Return the folder of the real hip: VTKMUSCLE_DATA, else beside the repository."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    return Path(os.environ.get("VTKMUSCLE_DATA", beside)) / "lhdl_hip"


def read_muscle(name: str) -> tuple[Floats, Ints]:
    """Return points, about their mean [mm], and triangles of a muscle of the real hip."""
    path = data_folder() / "muscles" / f"{name}.vtp"
    if not path.is_file():
        raise SystemExit(f"{path} is not there; set VTKMUSCLE_DATA to the folder that holds lhdl_hip")
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    surface = reader.GetOutput()
    points = vtk_to_numpy(surface.GetPoints().GetData()).astype(np.float64)
    triangles = vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(-1, 3).astype(np.int64)
    return points - points.mean(axis=0), triangles


@dataclass(frozen=True, eq=False)
class Problem:
    """A muscle at rest, which ends are fixed, and where a turn of one end takes it."""

    points: Floats
    triangles: Ints
    fixed_to: Ints
    transforms: Floats

    @property
    def mass(self) -> Floats:
        """Inverse masses: 1 free, 0 fixed."""
        return (self.fixed_to < 0).astype(np.float64)

    @property
    def free(self) -> NDArray[np.bool_]:
        """Free points."""
        return self.fixed_to < 0

    def with_fixed_in_place(self, positions: Floats) -> Floats:
        """Return positions with the fixed points where the bones are now."""
        placed = positions.copy()
        for bone, transform in enumerate(self.transforms):
            fixed = self.fixed_to == bone
            placed[fixed] = self.points[fixed] @ transform[:3, :3].T + transform[:3, 3]
        return placed

    def cold_start(self) -> Floats:
        """Return the muscle at rest, with its fixed points in place."""
        return self.with_fixed_in_place(self.points)

    def blended_start(self) -> Floats:
        """Return the muscle moved by the two motions, blended with harmonic weights."""
        _, weights = harmonic_weights(self.points, self.triangles, self.fixed_to)
        return self.with_fixed_in_place(blend_motions(self.transforms, weights, self.points))


def turned_muscle(name: str, angle: float, *, axis: int = 2) -> Problem:
    """Return a muscle whose far end turns by an angle [degrees] about a hinge at its near end.

    The ends are the outermost points along the muscle's long axis; the hinge is along its shortest axis
    (axis=2) or its second (axis=1).
    """
    points, triangles = read_muscle(name)
    axes = np.linalg.svd(points, full_matrices=False)[2]
    axes *= np.sign(axes[np.arange(3), np.abs(axes).argmax(axis=1)])[:, None]
    height = points @ axes[0]
    low, high = np.quantile(height, [FIXED_PART, 1.0 - FIXED_PART])
    fixed_to = np.where(height <= low, 0, np.where(height >= high, 1, -1))
    centre = points[fixed_to == 1].mean(axis=0)
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_rotvec(np.radians(angle) * axes[axis]).as_matrix()
    turn[:3, 3] = centre - turn[:3, :3] @ centre
    return Problem(points, triangles, fixed_to, np.array([turn, np.eye(4)]))
