"""The mode of the paper, against P21's Algorithm 2 written out line by line on plain numbers."""

import math
from itertools import pairwise

import numpy as np
import pytest
from spindle import spindle

from vtkmuscle.core.collision.obstacles import VoxelObstacle
from vtkmuscle.core.collision.voxels import OUTSIDE
from vtkmuscle.core.mesh.topology import mesh_topology
from vtkmuscle.core.motion.rigid import rotation_about
from vtkmuscle.core.pbd.anisotropy import edge_stiffness, harmonic_directions
from vtkmuscle.core.pbd.constraints import DIHEDRAL_FLOOR, VOLUME_FLOOR
from vtkmuscle.core.pbd.parameters import SolverParameters
from vtkmuscle.core.pbd.solver import MuscleSolver


def dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def minus(a, b):
    return [x - y for x, y in zip(a, b, strict=True)]


def transform_point(point, matrix):
    return [dot(matrix[k][:3], point) + matrix[k][3] for k in range(3)]


def moved_by(points, ids, masses, gradients, factor):
    for i, gradient in zip(ids, gradients, strict=True):
        points[i] = [x - factor * masses[i] * g for x, g in zip(points[i], gradient, strict=True)]


class PaperMuscle:
    """Algorithm 1 without fibres, and Algorithm 2."""

    def __init__(self, points, triangles, fixed_to, *, k, k_edges, k_shape, k_volume, dt, damping, force):
        self.rest = [[float(x) for x in point] for point in points]
        self.x = [list(point) for point in self.rest]
        self.v = [[0.0, 0.0, 0.0] for _ in points]
        self.triangles = [[int(i) for i in triangle] for triangle in triangles]
        self.fixed_to = [int(bone) for bone in fixed_to]
        self.mass = [1.0 if bone < 0 else 0.0 for bone in fixed_to]
        topology = mesh_topology(len(points), triangles)
        self.edges = topology.edges.tolist()
        self.quads = topology.quads.tolist()
        self.k, self.k_edges, self.k_shape, self.k_volume = k, k_edges.tolist(), k_shape, k_volume
        self.dt, self.damping, self.force = dt, damping, force
        self.d = [math.dist(self.rest[i], self.rest[j]) for i, j in self.edges]
        self.phi_0 = [self.angle(quad, self.rest)[0] for quad in self.quads]
        self.v_0, gradient = self.volume(self.rest)
        self.met = {"back to x": 0, "stopped": 0, "pushed": 0}
        self.floor = VOLUME_FLOOR * sum(m * dot(g, g) for m, g in zip(self.mass, gradient, strict=True))

    def step(self, bones, before, grids, iterations):
        """Lines 6 to 37, bones (b, 4, 4) now and before."""
        p = []
        for i, bone in enumerate(self.fixed_to):
            if bone >= 0:
                p.append(transform_point(self.rest[i], bones[bone]))  # line 9
            else:
                self.v[i] = [v + self.dt * f for v, f in zip(self.v[i], self.force, strict=True)]  # 11
                self.v[i] = [v * self.damping for v in self.v[i]]  # 12
                p.append([x + self.dt * v for x, v in zip(self.x[i], self.v[i], strict=True)])  # 13
        for _ in range(iterations):
            for e in range(len(self.edges)):  # 17 to 19
                self.project_distance(p, e, self.per_iteration(self.k * self.k_edges[e], iterations))
            self.project_volume(p, self.per_iteration(self.k_volume, iterations))  # 20
            for q in range(len(self.quads)):  # 21 to 23
                self.project_shape(p, q, self.per_iteration(self.k_shape, iterations))
            for i in range(len(p)):  # 24 to 30
                for bone, obstacle in grids.items():
                    if self.mass[i]:
                        self.keep_out(p, i, obstacle, bones[bone], before[bone])
        for i, bone in enumerate(self.fixed_to):  # 32 to 37
            if bone < 0:
                self.v[i] = [(new - old) / self.dt for new, old in zip(p[i], self.x[i], strict=True)]
            self.x[i] = p[i]

    @staticmethod
    def per_iteration(k, n):
        return 1.0 - (1.0 - k) ** (1.0 / n)

    def project_distance(self, p, e, k):
        """Equations 2 and 3."""
        i, j = self.edges[e]
        weight = self.mass[i] + self.mass[j]
        length = math.dist(p[i], p[j])
        if weight and length:
            unit = [x / length for x in minus(p[i], p[j])]
            gradients = unit, [-x for x in unit]
            moved_by(p, (i, j), self.mass, gradients, k * (length - self.d[e]) / weight)

    def volume(self, p):
        """Equations 4 and 5, with the sixth in the gradient, too."""
        total, gradient = 0.0, [[0.0] * 3 for _ in p]
        for i, j, k in self.triangles:
            total += dot(p[i], cross(p[j], p[k])) / 6.0
            for a, b, c in ((i, j, k), (j, k, i), (k, i, j)):
                part = cross(p[b], p[c])
                gradient[a] = [g + x / 6.0 for g, x in zip(gradient[a], part, strict=True)]
        return total, gradient

    def project_volume(self, p, k):
        total, gradient = self.volume(p)
        weight = sum(m * dot(g, g) for m, g in zip(self.mass, gradient, strict=True))
        factor = k * (total - self.v_0) / max(weight, self.floor)
        moved_by(p, range(len(p)), self.mass, gradient, factor)

    @staticmethod
    def angle(quad, p):
        """The dihedral angle with its sign, and the two normals."""
        i, j, k, m = quad
        e = minus(p[j], p[i])
        n1, n2 = cross(e, minus(p[k], p[i])), cross(minus(p[m], p[i]), e)
        return math.atan2(dot(cross(n1, n2), e) / math.sqrt(dot(e, e)), dot(n1, n2)), n1, n2

    def project_shape(self, p, q, k):
        """Equations 6 and 7, by the signed angle."""
        i, j, o1, o2 = quad = self.quads[q]
        angle, n1, n2 = self.angle(quad, p)
        change = (angle - self.phi_0[q] + math.pi) % (2.0 * math.pi) - math.pi
        change = min(max(change, -0.3), 0.3)  # ours, not the paper's: thin triangles would grow
        e = minus(p[j], p[i])
        length = math.sqrt(dot(e, e))
        m1, m2 = ([x / dot(n, n) for x in n] for n in (n1, n2))

        def mixed(a, b):
            return [(a * x + b * y) / length for x, y in zip(m1, m2, strict=True)]

        gradients = [
            mixed(dot(minus(p[j], p[o1]), e), dot(minus(p[j], p[o2]), e)),
            mixed(dot(minus(p[o1], p[i]), e), dot(minus(p[o2], p[i]), e)),
            [-length * x for x in m1],
            [-length * x for x in m2],
        ]
        squares = [dot(g, g) for g in gradients]
        weight = sum(self.mass[n] * s for n, s in zip(quad, squares, strict=True))
        if weight:
            factor = k * change / max(weight, DIHEDRAL_FLOOR * sum(squares))
            moved_by(p, quad, self.mass, gradients, factor)

    def keep_out(self, p, i, obstacle, now, before):
        """Section 3.2."""
        grid = obstacle.grid
        to_grid = obstacle.axes @ np.linalg.inv(now)
        scale = [1.0 / s for s in grid.spacing]

        def in_cells(point):
            at = transform_point(point, to_grid)
            return [(a - o) * s for a, o, s in zip(at, grid.origin, scale, strict=True)]

        def outside(at):
            cell = [math.floor(a) for a in at]
            beyond = any(not 0 <= c < n for c, n in zip(cell, grid.cells.shape, strict=True))
            return beyond or grid.cells[tuple(cell)] == OUTSIDE

        start, end = in_cells(p[i]), in_cells(self.x[i])
        if outside(start):
            return
        if not outside(end):  # the bone moved into the muscle
            p[i] = transform_point(self.x[i], now @ np.linalg.inv(before))
            self.met["pushed"] += 1
            return
        way = minus(end, start)
        faces = {0.0, 1.0}
        for a, w in zip(start, way, strict=True):
            if w:
                low, high = sorted((a, a + w))
                faces |= {(face - a) / w for face in range(math.ceil(low), math.floor(high) + 1)}
        times = sorted(t for t in faces if 0.0 <= t <= 1.0)
        for first, last in pairwise(times):
            middle = [a + (first + last) / 2.0 * w for a, w in zip(start, way, strict=True)]
            if last - first > 1e-12 and outside(middle):
                # In the cell of x itself p goes back to x, else to where the segment enters the cell.
                share = 1.0 if last == 1.0 else first
                self.met["back to x" if last == 1.0 else "stopped"] += 1
                p[i] = [a + share * (b - a) for a, b in zip(p[i], self.x[i], strict=True)]
                return
        raise AssertionError("x is outside, and no cell before it is")


def wall(bone, low, high):
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))])
    points = np.asarray(low) + corners * (np.asarray(high) - np.asarray(low))
    return VoxelObstacle(bone, points, triangles, n_max=40**3)


PAPER = {
    "prediction": "inertial",
    "solver": "gauss-seidel",
    "projection_order": "sequential",
    "bone_push": "transform",
    "contact_velocity": "keep",
}


def both(obstacles=(), *, k=1.0, k_shape=0.9, k_volume=1.0, iterations=3, force=(0.0, 0.0, 0.0)):
    """Return the solver in the mode of the paper, and the paper."""
    points, triangles, fixed_to = spindle(rings=7, around=7, seed=4)
    topology = mesh_topology(len(points), triangles)
    stiffness = edge_stiffness(points, topology.edges, harmonic_directions(points, topology, fixed_to))
    settings = SolverParameters(
        iterations=iterations,
        dt=0.5,
        stiffness=k,
        shape_stiffness=k_shape,
        volume_stiffness=k_volume,
        external_force=force,
        **PAPER,
    )
    ours = MuscleSolver(
        points, triangles, fixed_to, settings, edge_stiffness=stiffness, obstacles=tuple(obstacles)
    )
    paper = PaperMuscle(
        points,
        triangles,
        fixed_to,
        k=k,
        k_edges=stiffness,
        k_shape=k_shape,
        k_volume=k_volume,
        dt=settings.dt,
        damping=settings.velocity_kept,
        force=force,
    )
    return ours, paper


def followed(ours, paper, path, obstacles=()):
    """Return the largest difference over a path of the bones, and the last state."""
    state, before, worst = ours.rest_state(2), np.array([np.eye(4)] * 2), 0.0
    for now in path:
        state = ours.step(state, now)
        paper.step(now, before, {o.bone: o for o in obstacles}, ours.parameters.iterations)
        before = now
        worst = max(worst, float(np.abs(ours.points(state) - np.array(paper.x)).max()))
        free = ours.fixed_to < 0
        worst = max(worst, float(np.abs(state.velocities[free] - np.array(paper.v)[free]).max()))
    return worst, state


def bending(*angles):
    return [np.array([np.eye(4), rotation_about((0.0, 20.0, 0.0), (1, 0, 0), angle)]) for angle in angles]


@pytest.mark.parametrize("iterations", [1, 3, 10])
@pytest.mark.parametrize(("k", "k_shape", "k_volume"), [(1.0, 0.9, 1.0), (0.6, 0.2, 0.5)])
def test_the_mode_of_the_paper_is_algorithm_2(k, k_shape, k_volume, iterations):
    ours, paper = both(k=k, k_shape=k_shape, k_volume=k_volume, iterations=iterations, force=(0, -3.0, 0))
    worst, state = followed(ours, paper, bending(2, 4, 6, 8))
    assert np.abs(state.positions - ours.rest).max() > 5.0
    assert worst <= 1e-9


def test_the_mode_of_the_paper_meets_bones_as_section_3_2_has_it():
    # One wall that the muscle swings at, and one that comes at the muscle.
    obstacles = [wall(0, (-30, -40, -30), (30, -13, 30)), wall(1, (-40, 15.5, 5), (40, 30, 25))]
    ours, paper = both(obstacles, force=(0, -8.0, 0))
    worst, state = followed(ours, paper, bending(-2, -4, -6, -8), obstacles)
    assert all(count > 0 for count in paper.met.values()), paper.met
    assert state.colliding > 0
    assert worst <= 1e-5  # a stopped point is put 1e-6 of a cell behind the face it stops at
