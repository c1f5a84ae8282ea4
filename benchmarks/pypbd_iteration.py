"""Print the time of one iteration of pypbd: distance and bending constraints, no volume.

Runs in any Python that has pypbd and numpy, apart from vtkmuscle: ``python pypbd_iteration.py mesh.npz``.
"""

import sys
import time

import numpy as np
import pypbd as pbd


def main(path: str) -> None:
    """Time steps of few and of many iterations; the difference is the iterations' own."""
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
    times = {}
    for iterations in (10, 60):
        step.setValueUInt(step.MAX_ITERATIONS, iterations)
        best = np.inf
        for _ in range(5):
            start = time.perf_counter()
            step.step(model)
            best = min(best, time.perf_counter() - start)
        times[iterations] = best
    print((times[60] - times[10]) / 50.0)


if __name__ == "__main__":
    main(sys.argv[1])
