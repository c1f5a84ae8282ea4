"""The front of settling on the real hip: how smooth a muscle is by rounds and spread, and what that costs.

Run as ``python benchmarks/bench_settling.py [--muscles NAME ...] [--every N]``. The paths carry each muscle
once over flexion; what they give is settled with each number of rounds and each spread in turn, so that all
see the same machine. Printed are, the worst frame of each: the 95th percentile of the change of the angles
between triangles, the longest edge over its length at rest, the root mean square way from where the paths
carry a point [mm], the deepest point in a bone beyond its depth at rest [mm], and the error of the volume;
and the median processor time of a frame [ms], the least of three.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from real_hip import data_folder

from vtkmuscle import Scene
from vtkmuscle.core.bones.bone import depth_in
from vtkmuscle.core.fixed_muscle import FixedMuscle
from vtkmuscle.core.skinning import carried_muscle
from vtkmuscle.core.skinning.carried_muscle import CarriedMuscle
from vtkmuscle.data.moving_bones import fixed_points_of, rest_bones_of
from vtkmuscle.data.muscle_geometry import surface_of
from vtkmuscle.data.paths import path_lines_of
from vtkmuscle.run import muscle_pipeline

ROUNDS = (1, 2, 3, 5, 10, 20, 40)
SPREADS = (0.2, 0.3, 0.4, 0.6, 0.8)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--muscles", nargs="+")
    parser.add_argument("--every", type=int, default=9, help="each frame of this number is settled")
    arguments = parser.parse_args()
    scene = Scene.load(data_folder() / "scene.toml")
    for name in arguments.muscles or scene.muscles:
        front(scene, name, arguments.every)


def front(scene: Scene, name: str, every: int) -> None:
    """Print the front of a muscle."""
    pipeline = muscle_pipeline(scene, name)
    fixed = pipeline.fixed.update().output
    muscle = surface_of(fixed, name)
    fixed_to = fixed_points_of(muscle, list(scene.bones))
    bones = rest_bones_of(scene.bones_data(), name).shapes
    rest = path_lines_of(pipeline.taut_paths.update(time=scene.motion.times[0]).output, name).rest
    model = CarriedMuscle(FixedMuscle(muscle.points, muscle.triangles, fixed_to), rest, bones)
    poses = []
    for number, at in enumerate(scene.motion.times):
        paths = path_lines_of(pipeline.taut_paths.update(time=at).output, name)
        if number % every == 0:
            transforms = np.array([scene.motion.at(at).get(bone, np.eye(4)) for bone in scene.bones])
            poses.append((model.pose(paths.points, transforms, rounds=1).carried, transforms))
    shape, free = model.shape, fixed_to < 0

    def depths(points, transforms):
        return depth_in(((bone, transforms[number]) for number, bone in bones.items()), points)

    rest_depths = depths(shape.points[free], np.array([np.eye(4)] * len(scene.bones)))
    print(name)
    print("  rounds spread  angles   edge    way  depth   volume     ms")
    for spread in SPREADS:
        carried_muscle.SPREAD = spread
        one = carried_muscle.Settling(shape, fixed_to, bones)
        for rounds in ROUNDS:
            figures, took = [], []
            for carried, transforms in poses:
                times = []
                for _ in range(3):
                    began = time.thread_time()
                    surface = one.settle(carried, transforms, rounds=rounds).surface
                    times.append(1e3 * (time.thread_time() - began))
                took.append(min(times))
                report = shape.compare(surface)
                way = np.linalg.norm(surface - carried, axis=1)[free]
                depth = depths(surface[free], transforms) - rest_depths
                figures.append(
                    [
                        report.dihedral_error_p95,
                        report.edge_stretch_max,
                        float(np.sqrt(np.mean(way**2))),
                        float(depth.max(initial=0.0)),
                        abs(report.volume_ratio - 1.0),
                    ]
                )
            angles, edge, way_rms, depth_max, volume = np.max(figures, axis=0)
            print(
                f"  {rounds:6d} {spread:6.1f} {angles:7.2f} {edge:6.2f} {way_rms:6.3f} {depth_max:6.3f} "
                f"{volume:8.1e} {np.median(took):6.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
