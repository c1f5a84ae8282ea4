"""What a run will take of the memory, so that one that cannot end is not begun."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vtkmuscle.core.collision.distance_blocks import SIDE
from vtkmuscle.core.collision.distance_obstacle import CELLS_PER_DIAGONAL
from vtkmuscle.core.errors import InputError
from vtkmuscle.data.arrays import points_of, triangles_of
from vtkmuscle.filters.fibre_template_source import FibreTemplateSource
from vtkmuscle.scene.data import SceneData
from vtkmuscle.scene.faults import SceneError

#: Gigabytes that a run may take, in place of half of what the machine has.
VARIABLE = "VTKMUSCLE_MOST_MEMORY"

#: Of a triangle of a muscle, for the solver and the measures: 4.7 GB were measured with 768 000 [bytes].
_TRIANGLE = 6000
#: Of a point of a fibre in a kept frame, and at rest with its weights [bytes].
_FIBRE_POINT, _FIBRE_POINT_AT_REST = 150, 2500
#: Of a fibre in a kept frame, its measures and its path of 33 points with what it does to two bones [bytes].
_FIBRE = 400 + 33 * 24 + 2 * 48
#: Of a node of a distance grid, in the making [bytes].
_NODE = 10
#: Of a point of a muscle in a kept frame [bytes].
_POINT = 24


def check_memory(scene: SceneData, numbers: range) -> None:
    """Raise a SceneError for a run of these frames that would take more than half of the memory."""
    most = _most()
    if most is None:
        return
    parts = dict(estimated_memory(scene, numbers))
    total = sum(parts.values())
    if total > most:
        key, largest = max(parts.items(), key=lambda part: part[1])
        raise SceneError(
            f"the run would take about {total / 1e9:.3g} GB of memory, {largest / 1e9:.3g} GB of it for "
            f"this, but may take {most / 1e9:.3g} GB",
            key,
            "keep fewer frames or fibres, simplify surfaces, use larger cells, or set "
            f"{VARIABLE} to the gigabytes it may take",
            scene.files.get(""),
        )


def estimated_memory(scene: SceneData, numbers: range) -> Iterator[tuple[str, float]]:
    """Give the key of each part of a scene, and what a run of these frames needs for it [bytes]."""
    for name, muscle in scene.muscles.items():
        surface = muscle.surface
        yield f"muscles.{name}.surface", float(_TRIANGLE) * surface.GetNumberOfCells()
        frames = float(_POINT) * surface.GetNumberOfPoints() * len(numbers)
        if muscle.fibres is not None:
            declared = FibreTemplateSource.parameter_declarations
            count, segments = (
                float(muscle.fibres.get(word, declared[word].default)) for word in ("n_fibres", "resolution")
            )
            points = count * (segments + 1.0)
            frames += len(numbers) * (points * _FIBRE_POINT + count * _FIBRE)
            yield f"muscles.{name}.fibres", points * _FIBRE_POINT_AT_REST
        yield f"frames of muscles.{name}", frames
    cells = [scene.solver_of(name).get("grid_spacing") for name in scene.muscles]
    for name, bone in scene.bones.items():
        places, triangles = points_of(bone), triangles_of(bone, name)
        size = np.ptp(places, axis=0)
        diagonal = float(np.linalg.norm(size))
        a, b, c = (places[triangles[:, corner]] for corner in range(3))
        area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
        for cell in {float(cell or diagonal / CELLS_PER_DIAGONAL) for cell in cells}:
            if cell > 0.0:
                block = SIDE * cell
                blocks = 3.0 * area / block**2 + 0.5 * float(np.prod(size / block))
                yield f"bones.{name}", blocks * _NODE * SIDE**3


def _most() -> float | None:
    """Return what a run may take [bytes], None where the system does not tell."""
    chosen = os.environ.get(VARIABLE)
    if chosen:
        try:
            return float(chosen) * 1e9
        except ValueError:
            raise InputError("", f"{VARIABLE} is {chosen!r}, but must be a number of gigabytes") from None
    try:
        found = [float(os.sysconf("SC_PAGE_SIZE")) * float(os.sysconf("SC_PHYS_PAGES"))]
    except (AttributeError, ValueError, OSError):
        return None
    for limit in ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"):
        try:
            found.append(float(Path(limit).read_text(encoding="ascii")))
        except (OSError, ValueError):  # none, or "max"
            continue
    return 0.5 * min(found)
