"""Processor time and memory that a run takes: one that would not end is refused before it begins."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Iterator
from pathlib import Path

from vtkmuscle.core.errors import InputError
from vtkmuscle.filters.fibre_template_source import FibreTemplateSource
from vtkmuscle.filters.pbd_deformer import PBDDeformer
from vtkmuscle.scene.data import Muscle, SceneData
from vtkmuscle.scene.faults import SceneError

#: Processor time from which a run is announced, and from which it is refused [h].
LONG, MOST = 1.0 / 6.0, 1000.0
#: Time of a frame, and of a triangle in it (docs/validation/scale.rst) [s].
_FRAME_TIME, _TRIANGLE_TIME = 0.02, 2.5e-6
#: Time of a fibre in a frame: alone, for each other fibre, and at most. Fibres side by side settle the more
#: slowly the more there are: 2.7 ms each of 2048 in a spindle, 6.9 of 4096, 7.2 of 8192 [s].
_FIBRE_TIME, _DENSITY_TIME, _MOST_FIBRE_TIME = 1e-3, 1e-6, 7e-3
#: Time of a triangle in a round, and in an iteration of Algorithm 2: on the phantom hip, 200 of them [s].
_ROUND_TIME, _ITERATION_TIME = 6e-8, 1.5e-7

#: Environment variable for the gigabytes that a run may take, in place of half of the machine's.
VARIABLE = "VTKMUSCLE_MOST_MEMORY"
#: Memory of a process that solves muscles, beside theirs: 0.36 GB were measured with the phantom leg [bytes].
_PROCESS_BYTES = 4e8
#: Memory of a triangle for the solver and the measures: 4.7 GB were measured with 768 000 [bytes].
_TRIANGLE_BYTES = 6000
#: Memory of a point of a fibre in a frame that is kept in memory, and at rest with its weights [bytes].
_FIBRE_POINT_BYTES, _FIBRE_POINT_AT_REST_BYTES = 150, 2500
#: Memory of a fibre in such a frame, its measures and its path of 33 points with two levers,
#: and of its numbers in a frame that is in a file [bytes].
_FIBRE_BYTES, _FIBRE_NUMBERS_BYTES = 400 + 33 * 24 + 2 * 8, 200
#: Memory of a point of a muscle in a frame that is kept in memory [bytes].
_POINT_BYTES = 24


def check_duration(scene: SceneData, numbers: range) -> None:
    """Warn of a run of these frames that takes over ten minutes; raise a SceneError for over 1000 hours."""
    hours = {name: seconds / 3600.0 for name, seconds in estimated_seconds(scene, numbers)}
    total, longest = sum(hours.values()), max(hours, key=lambda name: hours[name])
    problem = f"the run takes about {total:.2g} hours of processor time, {hours[longest]:.2g} of them for "
    problem += repr(longest)
    remedy = "keep fewer frames or fibres, give fewer iterations, or simplify its surface"
    if total > MOST:
        raise SceneError(problem, f"muscles.{longest}", remedy, scene.files.get(""))
    if total > LONG:
        warnings.warn(f"{problem}; if that is too long {remedy}", stacklevel=3)


def estimated_seconds(scene: SceneData, numbers: range) -> Iterator[tuple[str, float]]:
    """Give each muscle's name, and the processor time that a run of these frames takes for it [s]."""
    for name, muscle in scene.muscles.items():
        settings = PBDDeformer(**scene.solver_of(name)).parameters()
        published = settings["quality"] == "published"
        frames = numbers[-1] + 1 if published else len(numbers)  # a frame needs those before it
        rounds = settings["iterations"] * (_ITERATION_TIME if published else _ROUND_TIME)
        fibres = _of_fibres(muscle, "n_fibres")
        triangles = 0 if scene.model == "paths" else muscle.surface.GetNumberOfCells()
        fibre = min(_FIBRE_TIME + fibres * _DENSITY_TIME, _MOST_FIBRE_TIME)
        yield name, frames * (_FRAME_TIME + fibres * fibre + triangles * (_TRIANGLE_TIME + rounds))


def check_memory(scene: SceneData, numbers: range, *, on_disk: bool) -> None:
    """Raise a SceneError for a run of these frames that would take more than half of the memory."""
    most = _most()
    if most is None:
        return
    parts = dict(estimated_memory(scene, numbers, on_disk=on_disk))
    total = sum(parts.values())
    if total > most:
        key, largest = max(parts.items(), key=lambda part: part[1])
        raise SceneError(
            f"the run would take about {total / 1e9:.3g} GB of memory, {largest / 1e9:.3g} GB of it for "
            f"this, but may take {most / 1e9:.3g} GB",
            key,
            f"keep fewer frames or fibres, simplify surfaces, or set {VARIABLE} to the gigabytes it may take",
            scene.files.get(""),
        )


def most_processes(scene: SceneData, numbers: range, *, on_disk: bool) -> float:
    """Return how many processes a run of these frames has the memory for, this one among them."""
    most = _most()
    if most is None:
        return math.inf
    taken = sum(size for _, size in estimated_memory(scene, numbers, on_disk=on_disk))
    return 1.0 + max(0.0, most - taken) // _PROCESS_BYTES


def estimated_memory(
    scene: SceneData, numbers: range, *, on_disk: bool = False
) -> Iterator[tuple[str, float]]:
    """Give the key of each part of a scene, and the memory that a run of these frames needs for it [bytes].

    Frames ``on_disk``, in the folder of the run, need memory for their numbers alone.
    """
    for name, muscle in scene.muscles.items():
        surface, fibres = muscle.surface, _of_fibres(muscle, "n_fibres")
        points = fibres * (_of_fibres(muscle, "resolution") + 1.0)
        yield f"muscles.{name}.surface", float(_TRIANGLE_BYTES) * surface.GetNumberOfCells()
        yield f"muscles.{name}.fibres", points * _FIBRE_POINT_AT_REST_BYTES
        frame = fibres * _FIBRE_NUMBERS_BYTES
        if not on_disk:
            frame = fibres * _FIBRE_BYTES + points * _FIBRE_POINT_BYTES
            frame += _POINT_BYTES * surface.GetNumberOfPoints()
        yield f"frames of muscles.{name}", float(len(numbers)) * frame


def _of_fibres(muscle: Muscle, setting: str) -> float:
    """Return a setting of a muscle's fibres, 0 for a muscle without fibres."""
    if muscle.fibres is None:
        return 0.0
    return float(muscle.fibres.get(setting, FibreTemplateSource.parameter_declarations[setting].default))


def _most() -> float | None:
    """Return the memory that a run may take [bytes], None where the system does not tell."""
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
