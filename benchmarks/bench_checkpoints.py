"""Memory against recomputation: what checkpoint_memory of PBDDeformer costs and saves.

The gluteus medius of the phantom hip flexes by 60 degrees in steps of 1 and is then played backwards, frame
by frame, and asked for frames at random. Steps are counted: they do not depend on the machine.
"""

from __future__ import annotations

import time

import numpy as np
from vtkmuscle.core.deformation.muscle import PathDrivenMuscle

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.phantoms import hip
from vtkmuscle.pipelines import deform

MUSCLE = "gluteus_medius"
ANGLES = np.arange(0.0, 61.0)
#: Frames that there is room for, None for all.
ROOM = (None, 16, 8, 4, 0)


def main() -> None:
    """Print steps and time per frame, per memory."""
    phantom = hip()
    table = np.array([phantom.motion.at(angle)["femur"] for angle in ANGLES])
    motion = RigidMotion(ANGLES, {"femur": table}, phantom.motion.centre)
    muscle = phantom.muscles[MUSCLE]
    steps, size = 0, 0.0
    step = PathDrivenMuscle.pose

    def counted(self, *arguments, **keywords):
        nonlocal steps, size
        steps += 1
        pose = step(self, *arguments, **keywords)
        size = 1e-6 * pose.nbytes
        return pose

    PathDrivenMuscle.pose = counted
    anywhere = np.random.default_rng(1).permutation(ANGLES)
    deform(muscle, phantom.bones, motion, phantom.attachments[MUSCLE]).update(time=float(ANGLES[0]))
    print(f"{MUSCLE}: {muscle.GetNumberOfPoints()} points, {size:.3f} MB per frame, {len(ANGLES)} frames")
    print("  room  checkpoint_memory   steps and ms per frame, backwards       at random")
    for room in ROOM:
        memory = 256.0 if room is None else 1.001 * room * size
        deformer = deform(
            muscle, phantom.bones, motion, phantom.attachments[MUSCLE], checkpoint_memory=memory
        )
        deformer.update(time=float(ANGLES[-1]))
        cells = []
        for order in (ANGLES[::-1], anywhere):
            steps, before = 0, time.perf_counter()
            for angle in order:
                deformer.update(time=float(angle))
            took = 1e3 * (time.perf_counter() - before)
            cells.append(f"{steps / len(order):12.2f} {took / len(order):8.1f}")
        print(f"  {'all' if room is None else room:>4}  {memory:14.3f} MB   {'     '.join(cells)}")


if __name__ == "__main__":
    main()
