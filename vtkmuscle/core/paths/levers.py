"""The levers of paths.

A lever is the change of a path's length as a coordinate moves the bones, with all else in equilibrium.
"""

from collections.abc import Sequence

import numpy as np

from vtkmuscle.core.jit import kernel, lane, vector_kernel
from vtkmuscle.core.paths.bone_contact import Load
from vtkmuscle.core.paths.equilibrium import axes_of, gather_pairs, pull_apart, write_point_rows
from vtkmuscle.core.paths.guides import Guides, with_bones
from vtkmuscle.core.paths.neighbours import WIDTH, NeighbourPairs
from vtkmuscle.core.types import SAME, FloatMap, Floats, Ints

#: The response to the bones' move is solved for in steps until a step changes the levers by less than
#: this part of the greatest speed of a path's end (rms of all paths), but in no more than so many. Levers of
#: three muscles of a real hip are 0.004 mm off the limit then (median of poses, rms of paths; 0.05 at most),
#: whatever the solution begins with.
TOLERANCE, STEPS = 1e-4, 16

#: A mode of the sheet that is softer than this, as a part of Newton's matrix, responds the less the softer
#: it is. In 755 poses of 20 real muscles the softest mode has 0.72 (median), and more than 0.1 in 97 of 100
#: poses. It has about 0 where a path that its neighbours press is about to buckle: the response has no bound
#: there, and says nothing of the pose after it. With 0.05 to 0.2 mean moment arms of a gluteus maximus in
#: such a pose are within 0.1 mm, and in all other poses the same.
SOFTEST = 0.1

#: See :func:`path_levers`.
Solver = tuple[FloatMap, FloatMap, FloatMap]


def path_levers(
    points: Floats, ends: tuple[Ints, Ints], loads: Sequence[tuple[int, Load]], twists: Floats, drift: Floats,
    solver: Solver, carried: tuple[Guides, Floats] | None = None,
) -> Floats:  # fmt: skip
    """Return the levers of paths as twists move bones.

    Levers are (v, f), or (v, k) of k fibres carried by the paths. As a bone moves by a small twist, the
    points fixed to the bone move, and the forces of the bone on free points go along; free points move until
    the sheet is in equilibrium again. Minus the change of a path's length is the path's lever, -dl/dq (tendon
    excursion; An et al. 1984, doi:10.1115/1.3138494). Where bones alone hold a path, the lever equals the
    lever of the pull at the path's end (principle of virtual work).

    points : (f, n, 3), in equilibrium [mm];
    ends : two (f,) int, bones of the starts and of the ends;
    loads : sequence of (int, Load), bones and their forces on the points;
    twists : (v, b, 6), of the bones: velocity at the origin and angular velocity, per unit of each of v
        coordinates;
    drift : (f, n, 3), displacement of the points between the ends, such as the last move: the first direction
        of the solution, which saves two steps;
    solver : three callables. The first takes velocities of the points (f, n, 3), ends included, and returns
        the change of the energy's gradient, 0 at the ends. The second takes a gradient likewise, and returns
        velocities of the inner points that about cancel the gradient by Newton's matrix. The third returns
        the product of that matrix with velocities;
    carried : (Guides, (b, 4, 4)), optional, carry the paths of further fibres, in a pose of the bones.
    """
    pull = pull_of(points)
    all_pull = pull if carried is None else pull_of(carried[0].carry(points, carried[1]))
    touched = sorted({*ends[0].tolist(), *ends[1].tolist(), *(bone for bone, _ in loads)})
    start = drift.copy()
    start[:, [0, -1]] = 0.0

    def lever(twist: Floats) -> Floats:
        rates, by_loads = rates_of(twist), np.zeros_like(points)
        velocity = with_bones(points, *ends, rates)  # to begin with
        for bone, (force, stiffness) in loads:  # which go with the bone, and turn with it
            add_load(stiffness, force, points, rates[bone], by_loads)
        gradient = solver[0](velocity)
        gradient[:, 1:-1] -= by_loads[:, 1:-1]
        least = TOLERANCE * float(np.linalg.norm(velocity[:, [0, -1]], axis=2).max())
        velocity += _response(gradient, start, pull, least, solver)
        if carried is not None:
            velocity = carried[0].carry(velocity, rates @ carried[1])
        return np.asarray(np.einsum("fni,fni->f", all_pull, velocity))  # the rates of shortening

    # All bones that move together leave the lengths as they are.
    relative = twists - twists[:, touched[:1]]
    levers = np.zeros((len(twists), len(all_pull)))
    for number in np.flatnonzero(relative[:, touched].any(axis=(1, 2))):
        levers[number] = lever(relative[number])
    return levers


def pull_of(paths: Floats) -> Floats:
    """Return the pull of a unit tension in paths on their points, (f, n, 3)."""
    segments = np.diff(paths, axis=1)
    sizes = np.linalg.norm(segments, axis=2, keepdims=True)
    return np.diff(segments / np.maximum(sizes, np.finfo(float).tiny), axis=1, prepend=0.0, append=0.0)


@kernel
def add_load(stiffness: Floats, force: Floats, points: Floats, motion: Floats, forces: Floats) -> None:
    """Add the forces of a load that moves points with a bone: K (M x) + M f.

    stiffness, force : (f, n, 3, 3), (f, n, 3), K and f of a :class:`~vtkmuscle.core.paths.bone_contact.Load`;
    motion : (4, 4), M, moves points x (f, n, 3) and turns forces, or gives their rates;
    forces : (f, n, 3), added to.
    """
    for a in range(len(points)):
        for i in range(points.shape[1]):
            x, y, z, f, k = points[a, i, 0], points[a, i, 1], points[a, i, 2], force[a, i], stiffness[a, i]
            u = motion[0, 0] * x + motion[0, 1] * y + motion[0, 2] * z + motion[0, 3]
            v = motion[1, 0] * x + motion[1, 1] * y + motion[1, 2] * z + motion[1, 3]
            w = motion[2, 0] * x + motion[2, 1] * y + motion[2, 2] * z + motion[2, 3]
            for c in range(3):
                turned = motion[c, 0] * f[0] + motion[c, 1] * f[1] + motion[c, 2] * f[2]
                forces[a, i, c] += k[c, 0] * u + k[c, 1] * v + k[c, 2] * w + turned


def rates_of(twist: Floats) -> Floats:
    """Return matrices (b, 4, 4) that take points to their velocities by a twist (b, 6)."""
    rates = np.zeros((len(twist), 4, 4))
    rates[:, :3, :3] = np.cross(twist[:, None, 3:], np.eye(3)).swapaxes(1, 2)
    rates[:, :3, 3] = twist[:, :3]
    return rates


def _response(gradient: Floats, start: Floats, pull: Floats, least: float, solver: Solver) -> Floats:
    """Return the velocities (f, n, 3) that change the gradient by minus the gradient.

    Galerkin's method in the space of ``start`` and of steps of Newton's method against the gradient left
    (Saad 2003, Iterative methods for sparse linear systems, doi:10.1137/1.9780898718003, chapter 6), until a
    step changes levers by less than ``least``. Newton's matrix leaves out the turning of tangents and of the
    bones' surfaces, and the change of the gradient includes the turning.
    """
    change, step, resist = solver
    velocity, left, count = np.zeros_like(gradient), gradient, 0
    directions, forces, changes = np.empty((3, STEPS + 1, gradient.size))
    matrix, right = np.empty((STEPS + 1, STEPS + 1)), np.empty(STEPS + 1)
    for number in range(STEPS + 1):
        way, force = directions[count], forces[count]
        way[:] = (step(left) if number else start).reshape(-1)
        force[:] = resist(way.reshape(gradient.shape)).reshape(-1)
        whole, shares = float(way @ force), forces[:count] @ way
        way -= shares @ directions[:count]
        force -= shares @ forces[:count]
        size = float(way @ force)
        if not size > SAME**2 * whole:  # no drift, or no further direction
            if number:
                break
            continue
        way /= np.sqrt(size)
        force /= np.sqrt(size)
        changes[count] = change(way.reshape(gradient.shape)).reshape(-1)
        right[count], count = -way @ gradient.reshape(-1), count + 1
        matrix[count - 1, :count] = changes[:count] @ way
        matrix[:count, count - 1] = directions[:count] @ changes[count - 1]
        parts = np.linalg.solve(_stiffened(matrix[:count, :count]), right[:count])
        last, velocity = velocity, (parts @ directions[:count]).reshape(gradient.shape)
        left = gradient + (parts @ changes[:count]).reshape(gradient.shape)
        by_step = np.einsum("fni,fni->f", pull, velocity - last)
        if number and float(np.sqrt((by_step**2).mean())) < least:
            break
    return velocity


def _stiffened(matrix: Floats) -> Floats:
    """Return the matrix (k, k) of a sheet in units of Newton's, without modes softer than :data:`SOFTEST`."""
    stiffness, modes = np.linalg.eigh(0.5 * (matrix + matrix.T))
    more = np.where(stiffness < SOFTEST, SOFTEST**2 / np.maximum(stiffness, SAME) - stiffness, 0.0)
    return np.asarray(matrix + modes * more @ modes.T)


@vector_kernel
def change_gradient(
    velocity: Floats, wider: Floats, held: Floats, neighbours: NeighbourPairs, rows: Floats, going: Floats,
    lanes: Floats, change: Floats,
) -> None:  # fmt: skip
    """Write the change of the gradient with moving points.

    Ends move too. The change is the derivative of the gradients from
    :func:`~vtkmuscle.core.paths.equilibrium.add_springs` and
    :func:`~vtkmuscle.core.paths.equilibrium.add_neighbours`, with turning tangents and changing widths.

    velocity, wider : (f, n, 3), (f,), velocities of the points, and rates of the paths' widths;
    held : (f, n, 3, 3), stiffness of the holds on each point, bones included;
    rows : (f n, 8), of :func:`~vtkmuscle.core.paths.equilibrium.write_point_rows`;
    going, lanes : (f n, 8), (14 WIDTH,), memory;
    change : (f, n, 3), overwritten, 0 at the ends.
    """
    f, n, _ = velocity.shape
    write_point_rows(velocity, wider, going)
    for a in range(f):
        for c in range(3):
            change[a, 0, c] = change[a, n - 1, c] = 0.0
        for i in range(1, n - 1):
            v0, v1, v2 = velocity[a, i, 0], velocity[a, i, 1], velocity[a, i, 2]
            for c in range(3):
                h = held[a, i, c]
                bow = 2.0 * velocity[a, i, c] - velocity[a, i - 1, c] - velocity[a, i + 1, c]
                change[a, i, c] = bow + (h[0] * v0 + h[1] * v1 + h[2] * v2)
    by = change.reshape(f * n, 3)
    for r in range(len(neighbours.pairs)):
        gather_pairs(rows, neighbours.pairs[r], lanes, 0)
        gather_pairs(going, neighbours.pairs[r], lanes, 7)
        constants = neighbours.constants[r].reshape(-1)
        for k in range(WIDTH):
            _change_spring(lanes, constants, k)
        pull_apart(by, neighbours.pairs[r], lanes)


@lane
def _change_spring(lanes: Floats, constants: Floats, k: int) -> None:
    t0, t1, t2, u0, u1, u2, size, ahead, apart = axes_of(lanes, k)
    w0, w1 = lanes[7 * WIDTH + k], lanes[8 * WIDTH + k]
    w2, widened = lanes[9 * WIDTH + k], lanes[10 * WIDTH + k]
    d0, d1, d2 = lanes[11 * WIDTH + k], lanes[12 * WIDTH + k], lanes[13 * WIDTH + k]
    per_size, per_apart, width = 1.0 / size, 1.0 / apart, lanes[3 * WIDTH + k]
    per_size, per_apart = per_size if size > 0.0 else 0.0, per_apart if apart > 0.0 else 0.0
    across, along, widened = constants[2 * WIDTH + k], constants[3 * WIDTH + k], lanes[10 * WIDTH + k]
    # The force is press u + shear t; press = turn apart.
    turn = across * (apart - width * constants[k]) * per_apart
    wide_ahead = constants[WIDTH + k] / (width * width)
    bend = (along * (ahead - wide_ahead) - turn * ahead) * per_size
    turned = (u0 * d0 + u1 * d1 + u2 * d2) * per_size
    parted = u0 * w0 + u1 * w1 + u2 * w2 - ahead * turned
    moved = t0 * w0 + t1 * w1 + t2 * w2 + apart * turned
    by_u = (across - turn) * parted - across * constants[k] * widened
    by_t = (along - turn) * moved + 2.0 * along * wide_ahead / width * widened
    by_t -= bend * (t0 * d0 + t1 * d1 + t2 * d2)
    for c, (w, d, u, t) in enumerate(((w0, d0, u0, t0), (w1, d1, u1, t1), (w2, d2, u2, t2))):
        lanes[c * WIDTH + k] = turn * w + bend * d + by_u * u + by_t * t
