"""Measure PBDDeformer on the muscles of a hip: its kernels, its update, and whether it is stable.

Run as ``python benchmarks/bench_pbd.py kernels``, ``update`` or ``stability``, this with ``--meshes two,one``
and ``--iterations 1,10`` for less of it, and ``--scene FILE --meshes two`` for muscles of another scene. The
data are those of ``VTKMUSCLE_DATA``, else ``../shared/data``, and there ``lhdl_hip``; coarser muscles are in
its folder ``muscles_lite``. Times are of the thread, beside those of plain scalar kernels, ``tools/naive.py``
beside the data: what counts is their ratio. ``stability`` prints the worst of a motion, and marks what is
beyond the bounds: volume within 1e-6, longest edge 12 times its length, 12 folded edges, and, from 10
iterations on, 95 % of the angles within 30 degrees of those at rest. Its meshes are 3000 and 1000 triangles,
all on two levels, and all on one; its steps are 1, 5 and 22 frames, of the hip 2, 10 and 44 degrees.
"""

from __future__ import annotations

import argparse
import itertools
import os
import runpy
import statistics
import time
from functools import cache
from pathlib import Path

import numpy as np
import pyvista as pv

from vtkmuscle import Scene
from vtkmuscle.core.fixed_muscle import FixedMuscle
from vtkmuscle.core.mesh.rest_shape import dihedral_angles, project_volume
from vtkmuscle.core.mesh.shared import keep_shared
from vtkmuscle.core.mesh.surface import mesh_topology
from vtkmuscle.core.pbd.solver import Parameters, PBDSolver
from vtkmuscle.core.pbd.sweep import project_edges
from vtkmuscle.data.arrays import checked_surface, field_array, points_of
from vtkmuscle.filters import BoneMotion, FixedPointDetector, PBDDeformer
from vtkmuscle.pipelines import decompose

DATA = Path(os.environ.get("VTKMUSCLE_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
HIP = DATA / "lhdl_hip"

#: What stability is measured of: meshes by their labels, steps [frames], iterations.
MESHES = {"3000": "3000", "1000": "1000", "two": None, "one": 0}
STEPS = (1, 5, 22)
ITERATIONS = (1, 3, 10, 100, 1000)

#: Degrees of a folded edge, and of the same at rest.
FOLDED, UNFOLDED = 149.0, 126.0

REPEATS = 60


class Muscles:
    """Muscles of a scene, with fixed points and fibres."""

    def __init__(self, scene=HIP / "scene.toml") -> None:
        self.scene = Scene.load(scene)
        self.bones = self.scene.bones_data()

    @cache  # noqa: B019 -- there is one
    def muscle(self, name, mesh):
        """Return a muscle with fixed points: that of the scene, or one of fewer triangles."""
        surface = self.scene.muscles[name].surface
        if mesh:
            surface = pv.read(HIP / "muscles_lite" / f"{name}_{mesh}.vtp")
        return FixedPointDetector().apply(surface, self.bones, self.scene.attachments_data(name))

    @cache  # noqa: B019
    def fibres(self, name):
        """Return the fibres of a muscle."""
        areas = self.scene.attachments_data(name)
        return decompose(self.scene.muscles[name].surface, areas, n_fibres=100).output

    def deformer(self, name, mesh, *, step=1, fibres=True, **settings):
        """Return a deformer over the motion by steps [frames], and its times."""
        last = len(self.scene.motion.times) - 1
        motion = self.scene.motion.part(np.unique(np.append(np.arange(0, last, step), last)))
        deformer = PBDDeformer(
            muscle=self.muscle(name, mesh),
            rest_bones=self.bones,
            bones=BoneMotion(bones=self.bones, motion=motion),
            fibres=self.fibres(name) if fibres else None,
            **settings,
        )
        return deformer, motion.times


def milliseconds(work, repeats):
    """Return the median time of the thread that a work takes [ms]."""
    times = []
    for _ in range(repeats + 1):
        start = time.thread_time()
        work()
        times.append(1e3 * (time.thread_time() - start))
    return statistics.median(times[1:])


def naive_of(points, triangles):
    """Return an iteration of the plain kernels on a mesh, as a function."""
    naive = runpy.run_path(str(DATA.parent / "tools" / "naive.py"))
    faces, x = triangles.astype(np.int32), points - points.mean(axis=0)
    quads, mass, gradient = naive["topology"](faces), np.ones(len(x)), np.zeros_like(x)
    lengths = np.linalg.norm(x[quads[:, 0]] - x[quads[:, 1]], axis=1)
    volume = np.einsum("ij,ij->", x[faces[:, 0]], np.cross(x[faces[:, 1]], x[faces[:, 2]]))
    angles, y = np.zeros(len(quads)), x.copy()

    def iterate():
        y[:] = x
        naive["distance"](y, mass, quads, lengths)
        naive["volume"](y, mass, faces, volume, gradient)
        naive["dihedral"](y, mass, quads, angles, 0.9)

    return iterate


def kernels(muscles):
    """Print the time of an iteration beside that of the plain kernels, in turns."""
    for name, mesh in itertools.product(muscles.scene.muscles, (None, "1000")):
        points, triangles = checked_surface(muscles.muscle(name, mesh), name)
        free = np.full(len(points), -1)
        solver = PBDSolver(FixedMuscle(points, triangles, free), Parameters())
        p = np.vstack([solver.rest, np.zeros(3)])

        def iterate(solver=solver, p=p):
            p[:-1] = solver.rest
            project_edges(p, solver.rows.points, solver.rows.constants, True, True, True, solver._buffer)
            project_volume(p[:-1], *solver._volume)

        plain = naive_of(points, triangles)
        turns = [(milliseconds(iterate, 5), milliseconds(plain, 5)) for _ in range(REPEATS // 5)]
        ours, theirs = (statistics.median(column) for column in zip(*turns, strict=True))
        print(
            f"{name:16s} {len(triangles):6d} triangles: {ours:.3f} ms, plain {theirs:.3f} ms, "
            f"{theirs / ours:.2f} times as fast",
            flush=True,
        )


def updates(muscles):
    """Print what a frame takes, pipeline and all, in iterations of the plain kernels on the full mesh."""
    for name in muscles.scene.muscles:
        plain = naive_of(*checked_surface(muscles.scene.muscles[name].surface, name))
        for label, mesh, settings in (
            ("two levels", None, {}),
            ("3000 triangles", "3000", {}),
            ("1000 triangles", "1000", {}),
        ):
            deformer, times = muscles.deformer(name, mesh, **settings)
            deformer.update(float(times[0]))
            of_naive, of_frames = [], []
            for number in times[1:]:
                of_naive.append(milliseconds(plain, 1))
                start = time.thread_time()
                deformer.update(float(number))
                of_frames.append(1e3 * (time.thread_time() - start))
            frame, one = statistics.median(of_frames), statistics.median(of_naive)
            print(
                f"{name:16s} {label:14s} 10 iterations: a frame {frame:.2f} ms, "
                f"{frame / one:.2f} plain iterations of {one:.2f} ms",
                flush=True,
            )


def worst_of(muscles, name, mesh, step, iterations, *, fibres, bones):
    """Return the worst volume, stretch, turn, folds and depth of a motion."""
    settings = {"iterations": iterations, "measure_shape": True, "measure_penetration": bones}
    settings["collision"] = "sdf" if bones else "off"
    if mesh == 0:
        settings["solved_triangles"] = 0
    deformer, times = muscles.deformer(name, mesh, step=step, fibres=fibres, **settings)
    rest, triangles = checked_surface(muscles.muscle(name, mesh), name)
    quads = mesh_topology(len(rest), triangles).quads
    unfolded = np.abs(dihedral_angles(rest, quads)[0]) < np.radians(UNFOLDED)
    worst, taken = np.zeros(5), []
    for moment in times[1:]:
        start = time.thread_time()
        out = deformer.update(float(moment)).output
        taken.append(1e3 * (time.thread_time() - start))
        angles = np.abs(dihedral_angles(points_of(out), quads)[0])
        folds = (unfolded & (angles > np.radians(FOLDED))).sum()
        names = ("VolumeRatio", "EdgeStretchMax", "DihedralErrorP95", "PenetrationMax")
        volume, stretch, turn, depth = (
            0.0 if field_array(out, key) is None else float(field_array(out, key)[0]) for key in names
        )
        worst = np.maximum(worst, [abs(volume - 1.0), stretch, turn, folds, depth])
    return worst, statistics.median(taken)


def stability(muscles, meshes, counts):
    """Print the worst of each motion, those that take longest last."""
    both = (True, False)
    cells = list(itertools.product(counts, meshes, STEPS, muscles.scene.muscles, both, both))
    beyond = 0
    print("muscle           mesh  step  it. fibres bones |    V-1  edge  turn folds depth     ms")
    for iterations, label, step, name, fibres, bones in cells:
        worst, taken = worst_of(muscles, name, MESHES[label], step, iterations, fibres=fibres, bones=bones)
        volume, stretch, turn, folds, depth = worst
        sane = volume <= 1e-6 and stretch <= 12 and folds <= 12 and (iterations < 10 or turn <= 30)
        beyond += not sane
        print(
            f"{name:16s} {label:>4s} {step:5d} {iterations:4d} {'yes' if fibres else 'no':>6s} "
            f"{'yes' if bones else 'no':>5s} | {volume:6.0e} {stretch:5.1f} {turn:5.1f} {folds:5.0f} "
            f"{depth:5.2f} {taken:6.1f}{'' if sane else '  beyond'}",
            flush=True,
        )
    print(f"{beyond} of {len(cells)} beyond the bounds")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("kernels", "update", "stability"))
    parser.add_argument("--meshes", default=",".join(MESHES))
    parser.add_argument("--iterations", default=",".join(map(str, ITERATIONS)))
    parser.add_argument("--scene", default=HIP / "scene.toml")
    given = parser.parse_args()
    with keep_shared():  # the bones are the same for all
        muscles = Muscles(given.scene)
        if given.what == "stability":
            stability(muscles, given.meshes.split(","), [int(count) for count in given.iterations.split(",")])
        else:
            {"kernels": kernels, "update": updates}[given.what](muscles)
