"""A scene of few triangles on disk, for tests of reading, running and the command line."""

from pathlib import Path

import numpy as np
from vtkmodules.vtkFiltersSources import vtkSphereSource

from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.data.arrays import points_of, with_points
from vtkmuscle.data.attachments import AttachmentArea, attachments_from
from vtkmuscle.io import write_motion_table, write_polydata

TOML = """
name = "tiny"
units = "mm"

[bones.upper]
surface = "bones/upper.vtp"

[bones.lower]
surface = "bones/lower.vtp"

[motion]
bone = "lower"
transforms = "motion.csv"
time = "time"
centre = [0.0, -15.0, 0.0]

[muscles.spindle]
surface = "muscles/spindle.vtp"
fibres = { template = "parallel", n_fibres = 6, resolution = 5 }
attachments = [
  { role = "origin", bone = "upper", landmarks = "attachments/origin.vtp" },
  { role = "insertion", bone = "lower", landmarks = "attachments/insertion.vtp" },
]

[solver]
iterations = 3
"""

#: A template of one part.
TEMPLATE = """sheets = [
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
    [[0.3, 0, 0.5], [1, 0, 0.5], [1, 1, 0.5], [0.3, 1, 0.5]],
    [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
]
"""
#: The motion of the scene, and a hinge in its place.
MOTION = TOML[TOML.index("[motion]") : TOML.index("[muscles")]
HINGE = """
[motion.hinge]
bone = "lower"
centre = [0.0, -15.0, 0.0]
axis = [1.0, 0.0, 0.0]
angles = [0, 20, 5]
"""


def ellipsoid(half_axes, centre, resolution=12):
    """Return a closed surface of triangles about a centre."""
    source = vtkSphereSource(radius=1.0, theta_resolution=resolution, phi_resolution=resolution)
    source.Update()
    surface = source.GetOutput()
    surface.GetPointData().Initialize()
    return with_points(surface, points_of(surface) * np.asarray(half_axes, dtype=float) + centre)


def ring(height):
    """Return landmarks around an end of the muscle."""
    angles = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    radius = 8.0 * np.sqrt(1 - (height / 40.0) ** 2)
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(8, height)])


def edit(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def write_tiny_scene(folder: Path) -> Path:
    """Write a spindle between two bones, of which the lower one turns by 20 degrees in 5 frames."""
    write_polydata(folder / "muscles/spindle.vtp", ellipsoid((8, 8, 40), (0, 0, 0), 16))
    write_polydata(folder / "bones/upper.vtp", ellipsoid((6, 6, 20), (0, -15, 30)))
    write_polydata(folder / "bones/lower.vtp", ellipsoid((6, 6, 20), (0, -15, -30)))
    areas = [
        AttachmentArea("origin", "upper", ring(34.0), True),
        AttachmentArea("insertion", "lower", ring(-34.0), True),
    ]
    for number, area in enumerate(areas):
        write_polydata(folder / f"attachments/{area.role}.vtp", attachments_from(areas).GetBlock(number))
    motion = hinge("lower", (0, -15, 0), (1, 0, 0), [0, 5, 10, 15, 20])
    write_motion_table(folder / "motion.csv", motion, "lower")
    (folder / "scene.toml").write_text(TOML)
    return folder / "scene.toml"
