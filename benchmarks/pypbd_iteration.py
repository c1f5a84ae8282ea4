"""Time an iteration of pypbd whenever asked to: distance and bending constraints, no volume.

Runs in any Python that has pypbd and numpy, apart from vtkmuscle: ``python pypbd_iteration.py mesh.npz``. For
each line on standard input it prints the time of an iteration [s of the processor].
"""

import sys
import time

import numpy as np
import pypbd as pbd

FEW, MANY = 10, 60


def main(path: str) -> None:
    """Time a step of few and one of many iterations; the difference is the iterations' own."""
    mesh = np.load(path)
    simulation = pbd.Simulation.getCurrent()
    simulation.initDefault()
    model = simulation.getModel()
    surface = model.addTriangleModel(list(mesh["points"]), mesh["triangles"].reshape(-1).tolist())
    particles = model.getParticles()
    for i in range(len(mesh["points"])):
        particles.setMass(i, float(mesh["mass"][i]))
    model.addClothConstraints(surface, 1, 1.0, 1.0, 1.0, 1.0, 0.3, 0.3, False, False)
    model.addBendingConstraints(surface, 1, 0.9)
    model.initConstraintGroups()
    for i in range(len(mesh["points"])):
        particles.setPosition(i, mesh["moved"][i])
    step = simulation.getTimeStep()
    step.setValueUInt(step.NUM_SUB_STEPS, 1)
    for _ in sys.stdin:
        times = {}
        for iterations in (FEW, MANY):
            step.setValueUInt(step.MAX_ITERATIONS, iterations)
            start = time.process_time()
            step.step(model)
            times[iterations] = time.process_time() - start
        print((times[MANY] - times[FEW]) / (MANY - FEW), flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
