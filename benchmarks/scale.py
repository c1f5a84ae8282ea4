"""How time and memory grow: with triangles, fibres, muscles and frames; a process for each size.

    python benchmarks/scale.py
    python benchmarks/scale.py --only triangles muscles --most 100000 --write

Each row is a run of a scene as ``vtkmuscle run`` runs it, figures and page apart, at quality ``"preview"``,
on one thread. Times are of the processor: of the set-up with the first frame, and of a further frame. Memory
is what the process holds at most beyond what it held before the run. ``--write`` writes the table of the page
on scale. The first run compiles what is not compiled yet: run it twice.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyvista
from bench_leg import memory

from vtkmuscle import Scene, phantoms
from vtkmuscle.core.motion.rigid import RigidMotion

TABLE = Path(__file__).resolve().parents[1] / "docs/validation/scale_tables/scale.csv"
SIZES = {
    "triangles": (1_000, 10_000, 100_000, 1_000_000),
    "fibres": (10, 100, 1_000, 10_000),
    "muscles": (1, 10, 100),
    "frames": (10, 100, 1_000),
}
#: Of the scene that grows in one of these ways.
FRAMES, FIBRES = 4, 25


def scene_of(kind: str, size: int) -> tuple[Scene, int]:
    """Return the spindle over the hinge, grown in one way, and how many frames of it to run."""
    n_fibres = size if kind == "fibres" else FIBRES
    scene = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=n_fibres).with_settings(
        quality="preview"
    )
    ((name, muscle),) = scene.muscles.items()
    frames = size if kind == "frames" else FRAMES
    last = len(scene.motion.times) - 1
    there_and_back = np.arange(frames) % (2 * last)
    numbers = np.minimum(there_and_back, 2 * last - there_and_back)
    transforms = {bone: poses[numbers] for bone, poses in scene.motion.transforms.items()}
    muscles = {name: muscle}
    if kind == "muscles":
        muscles = {f"{name}_{number}": muscle for number in range(size)}
    if kind == "triangles":
        muscles = {name: replace(muscle, surface=_remeshed(muscle.surface, size))}
    motion = RigidMotion(np.arange(float(frames)), transforms)
    return replace(scene, muscles=muscles, motion=motion), frames


def _remeshed(surface: Any, triangles: int) -> Any:
    """Return the surface with about so many triangles: some are merged, then each divided in four."""
    mesh, parts = pyvista.wrap(surface), 1
    while mesh.n_cells * parts < triangles:
        parts *= 4
    if mesh.n_cells * parts > triangles:
        mesh = mesh.decimate(1.0 - triangles / (mesh.n_cells * parts)).clean()
    return mesh.subdivide(round(math.log(parts, 4)), "linear") if parts > 1 else mesh


def measured(kind: str, size: int) -> dict[str, float]:
    """Return a row of the table."""
    scene, frames = scene_of(kind, size)
    before, began = memory(), time.process_time()
    ends: dict[str, list[float]] = {name: [] for name in scene.muscles}

    def note(muscle: str, _: str, part: float) -> None:
        if part > 0.0:  # a frame is done
            ends[muscle].append(time.process_time())

    result = scene.run(figures=False, workers=1, progress=note)
    taken = time.process_time() - began
    further = sum(at[-1] - at[0] for at in ends.values()) / (len(ends) * (frames - 1))
    rows = [row for muscle in result.report["muscles"].values() for row in muscle["frames"]]
    return {
        "triangles": sum(muscle.surface.GetNumberOfPolys() for muscle in scene.muscles.values()),
        "set_up_s": (taken - further * len(ends) * (frames - 1)) / len(ends),
        "frame_ms": 1000.0 * further,
        "memory_mb": memory() - before,
        "volume_error": max(abs(row["volume_ratio"] - 1.0) for row in rows),
    }


def main() -> None:
    """Measure each size in a process of its own, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=SIZES, default=list(SIZES))
    parser.add_argument("--most", type=int, default=1_000_000, help="largest number of triangles")
    parser.add_argument("--write", action="store_true", help="write the page's table")
    parser.add_argument("--one", nargs=2, metavar=("KIND", "SIZE"), help="measure one size in this process")
    given = parser.parse_args()
    if given.one:
        print(json.dumps(measured(given.one[0], int(given.one[1]))))
        return
    lines = ["grows,size,set-up per muscle [s],frame [ms],memory [MB],volume error [1]"]
    print(lines[0])
    for kind in given.only:
        for size in SIZES[kind]:
            if kind == "triangles" and size > given.most:
                continue
            command = [sys.executable, __file__, "--one", kind, str(size)]
            found = subprocess.run(command, check=True, capture_output=True, text=True).stdout
            row = json.loads(found.splitlines()[-1])
            shown = int(row["triangles"]) if kind == "triangles" else size
            numbers = f"{row['set_up_s']:.3g},{row['frame_ms']:.3g},{row['memory_mb']:.0f}"
            lines.append(f"{kind},{shown},{numbers},{row['volume_error']:.0e}")
            print(lines[-1], flush=True)
    if given.write:
        TABLE.parent.mkdir(parents=True, exist_ok=True)
        TABLE.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
