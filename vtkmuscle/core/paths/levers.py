"""The levers of paths.

A lever is the change of a path's length as a coordinate moves the bones, with all else in equilibrium.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping

import numpy as np

from vtkmuscle.core.jit import vector_kernel
from vtkmuscle.core.paths.bone_contact import Load
from vtkmuscle.core.paths.equilibrium import axes_of_pair
from vtkmuscle.core.paths.guides import Guides
from vtkmuscle.core.paths.neighbours import Neighbours
from vtkmuscle.core.types import Floats, Ints

#: The response to the bones' move is solved for in steps until one of them changes the levers by less than
#: this part of the greatest speed of a path's end (rms of all paths), but in no more than so many. Levers of
#: three muscles of a real hip are 0.004 mm off the limit then (median of poses, rms of paths; 0.05 at most),
#: whatever the solution begins with.
TOLERANCE, STEPS = 1e-4, 16

#: A step that changes the levers by more than this many times the largest before is left out, and the last.
#: Steps get smaller, or grow up to threefold; by ten times they grow where a path is about to snap to another
#: equilibrium: the response has no bound there, and says nothing of the pose after it.
LARGEST_GROWTH = 5.0


def path_levers(
    points: Floats,
    ends: tuple[Ints, Ints],
    loads: Mapping[int, Load],
    twists: Floats,
    drift: Floats,
    solver: tuple[Callable[[Floats], Floats], Callable[[Floats], Floats]],
    carried: tuple[Guides, Floats] | None = None,
) -> Floats:
    """Return the levers of paths as twists move bones.

    Levers are (v, f), or (v, k) of k fibres carried by the paths. As a bone moves by a small twist, the
    points fixed to the bone move, and the forces of the bone on free points go along; free points move until
    the sheet is in equilibrium again. Minus the change of a path's length is the path's lever, -dl/dq (tendon
    excursion; An et al. 1984, doi:10.1115/1.3138494). Where bones alone hold a path, the lever equals the
    lever of the pull at the path's end (principle of virtual work).

    Parameters
    ----------
    points : (f, n, 3) array
        In equilibrium [mm].
    ends : two (f,) int arrays
        Bones of the starts and of the ends.
    loads : mapping of int to Load
        Forces of each bone on the points.
    twists : (v, b, 6) array
        Of the bones: velocity at the origin and angular velocity, per unit of each of v coordinates.
    drift : (f, n, 3) array
        Displacement of the points between the ends, such as the last move: the solution begins with the best
        multiple of the drift, and so saves two steps.
    solver : two callables
        The first takes velocities of the points (f, n, 3, v), ends included, and returns the change of the
        energy's gradient, 0 at the ends. The second takes gradients likewise, and returns velocities of the
        inner points that about cancel the gradients.
    carried : (Guides, (b, 4, 4) array), optional
        Carry the paths of further fibres, in a pose of the bones.
    """
    paths = points if carried is None else carried[0].carry(points, carried[1])
    segments = np.diff(paths, axis=1)
    sizes = np.linalg.norm(segments, axis=2, keepdims=True)
    pull = np.diff(segments / np.maximum(sizes, np.finfo(float).tiny), axis=1, prepend=0.0, append=0.0)
    levers = np.zeros((len(paths), len(twists)))
    starting, ending = ends
    touched = sorted({*starting.tolist(), *ending.tolist(), *loads})
    # All bones that move together leave the lengths as they are.
    relative = twists - twists[:, touched[:1]]
    moved = relative[:, touched].any(axis=(1, 2))
    if not moved.any():
        return levers.T
    relative = relative[moved]

    def shortening(velocity: Floats, twists: Floats | None = None) -> Floats:
        """Return the rates of shortening (k, v) of all paths; without twists the ends stay."""
        if carried is not None:
            ways = np.moveaxis(velocity, 3, 0)
            moves = [None] * len(ways) if twists is None else _moved_by(twists, carried[1])
            velocity = np.stack(list(map(carried[0].carry, ways, moves)), axis=3)
        rates: Floats = np.einsum("fni,fniv->fv", pull, velocity)
        return rates

    along = np.linspace(0.0, 1.0, points.shape[1])
    given = np.zeros((*points.shape, np.count_nonzero(moved)))
    by_loads = np.zeros_like(given)
    for bone in touched:
        linear, angular = relative[:, bone, :3], relative[:, bone, 3:]
        velocity = linear.T + _turned(points, angular)
        # To begin with points go with the ends by how near they are to each.
        part = np.outer(starting == bone, 1.0 - along) + np.outer(ending == bone, along)
        given += part[..., None, None] * velocity
        if bone in loads:  # which go with it, and turn with it
            force, stiffness = loads[bone]
            by_loads += np.einsum("fnij,fnjv->fniv", stiffness, velocity) + _turned(force, angular)
    both = np.concatenate([given, drift[..., None]], axis=3)
    both[:, [0, -1], :, -1] = 0.0
    gradient, along_drift = np.split(solver[0](both), [-1], axis=3)
    gradient[:, 1:-1] -= by_loads[:, 1:-1]
    part = -_products(gradient, along_drift) / (_products(along_drift, along_drift) or 1.0)
    given += part * both[..., -1:]
    gradient += part * along_drift
    found = shortening(given, relative)
    speed = np.linalg.norm(given[:, [0, -1]], axis=2).max(axis=(0, 1))
    going = np.ones(len(speed), dtype=np.bool_)  # each for itself: none depends on the others
    largest = np.full(len(speed), np.nan)
    for lever in _responses(gradient, shortening, *solver):
        size = np.sqrt((lever**2).mean(axis=0))
        going &= ~(size > LARGEST_GROWTH * largest)
        found[:, going] += lever[:, going]
        largest = np.fmax(largest, size)
        going &= size >= TOLERANCE * speed
        if not going.any():
            break
    levers[:, moved] = found
    return levers.T


def _moved_by(twists: Floats, transforms: Floats) -> Floats:
    """Return the changes (v, b, 4, 4) of transforms (b, 4, 4) by twists (v, b, 6)."""
    changes = np.zeros((*twists.shape[:2], 4, 4))
    changes[..., :3, :] = np.cross(twists[:, :, None, 3:], transforms[:, :3].swapaxes(1, 2)).swapaxes(2, 3)
    changes[..., :3, 3] += twists[..., :3]
    return changes


def _turned(vectors: Floats, angular: Floats) -> Floats:
    """Return the change of turning vectors.

    Vectors (..., 3) turn with angular velocities (v, 3); the change is (..., 3, v).
    """
    return np.stack([np.cross(axis, vectors) for axis in angular], axis=-1)


def _responses(
    gradient: Floats,
    shortening: Callable[[Floats], Floats],
    change: Callable[[Floats], Floats],
    step: Callable[[Floats], Floats],
) -> Iterator[Floats]:
    """Give the levers at each step of the velocities.

    Levers are (f, v). The velocities change the gradient by minus the gradient. Generalised conjugate
    residuals (Eisenstat, Elman, Schultz 1983, doi:10.1137/0720023) solve for each of the v velocities
    separately. The preconditioner is a step of Newton's method: Newton's matrix leaves out the turning of
    tangents and of the bones' surfaces, and the change of the gradient includes the turning.
    """
    left = gradient
    before: list[tuple[Floats, Floats, Floats]] = []
    for _ in range(STEPS):
        way = step(left)
        by_way = change(way)
        for other, by_other, size in before:
            part = _products(by_way, by_other) / size
            way -= part * other
            by_way -= part * by_other
        size = _products(by_way, by_way)
        size[size == 0.0] = 1.0
        part = _products(left, by_way) / size
        left -= part * by_way
        before.append((way, by_way, size))
        yield -part * shortening(way)


def _products(a: Floats, b: Floats) -> Floats:
    """Return the v scalar products of a and b.

    Both arrays are (f, n, 3, v).
    """
    products: Floats = np.einsum("fniv,fniv->v", a, b)
    return products


@vector_kernel
def change_gradient(
    x: Floats,
    velocity: Floats,
    held: Floats,
    neighbours: Neighbours,
    widths: Floats,
    widening: Floats,
    wider: Floats,
    turning: Floats,
    change: Floats,
) -> None:
    """Write the change of the gradient with moving points.

    Ends move too. The change is the derivative of the gradients from
    :func:`~vtkmuscle.core.paths.equilibrium.add_springs` and
    :func:`~vtkmuscle.core.paths.equilibrium.add_neighbours`, with turning tangents and changing widths.

    Parameters
    ----------
    x : (f, n, 3) array
        Positions [mm].
    velocity : (f, n, 3, v) array
        Of the points, v of them.
    held : (f, n, 3, 3) array
        Stiffness of the holds on each point, bones included.
    widths, widening : (f,) arrays
        Widths of the paths, and change of the widths with the paths' lengths [1/mm].
    wider, turning : (f, v), (f, n, 3, v) arrays
        Working memory: rates of the paths' widths, and change of the tangents at the points.
    change : (f, n, 3, v) array
        Overwritten, 0 at the ends.
    """
    f, n, _, ways = velocity.shape
    wider[:] = 0.0
    for a in range(f):
        for i in range(n - 1):
            s0, s1, s2 = x[a, i + 1, 0] - x[a, i, 0], x[a, i + 1, 1] - x[a, i, 1], x[a, i + 1, 2] - x[a, i, 2]
            length = math.sqrt(s0 * s0 + s1 * s1 + s2 * s2)
            part = widening[a] / length if length > 0.0 else 0.0
            for v in range(ways):
                wider[a, v] += part * (
                    s0 * (velocity[a, i + 1, 0, v] - velocity[a, i, 0, v])
                    + s1 * (velocity[a, i + 1, 1, v] - velocity[a, i, 1, v])
                    + s2 * (velocity[a, i + 1, 2, v] - velocity[a, i, 2, v])
                )
        for c in range(3):
            for v in range(ways):
                change[a, 0, c, v] = change[a, n - 1, c, v] = 0.0
        for i in range(1, n - 1):
            for c in range(3):
                h0, h1, h2 = held[a, i, c, 0], held[a, i, c, 1], held[a, i, c, 2]
                for v in range(ways):
                    before, after = velocity[a, i - 1, c, v], velocity[a, i + 1, c, v]
                    turning[a, i, c, v] = after - before
                    change[a, i, c, v] = (2.0 * velocity[a, i, c, v] - before - after) + (
                        h0 * velocity[a, i, 0, v] + h1 * velocity[a, i, 1, v] + h2 * velocity[a, i, 2, v]
                    )
    p, by = x.reshape(f * n, 3), change.reshape(f * n, 3, ways)
    going, turns = velocity.reshape(f * n, 3, ways), turning.reshape(f * n, 3, ways)
    for e in range(len(neighbours.pairs)):
        i, j = neighbours.pairs[e, 0], neighbours.pairs[e, 1]
        t0, t1, t2, u0, u1, u2, size, ahead, apart = axes_of_pair(p, i, j)
        if not size > 0.0:
            continue
        per_size, per_apart = 1.0 / size, 1.0 / apart if apart > 0.0 else 0.0
        # The force is press u + shear t; press = turn apart.
        width = 0.5 * (widths[i // n] + widths[j // n])
        across, along = neighbours.stiffness[e, 0], neighbours.stiffness[e, 1]
        turn = across * (apart - width * neighbours.distances[e]) * per_apart
        shear = along * (ahead - neighbours.ahead[e] / (width * width))
        bend = (shear - turn * ahead) * per_size
        press_wider = -across * neighbours.distances[e]
        shear_wider = 2.0 * along * neighbours.ahead[e] / (width * width * width)
        for v in range(ways):
            w0 = going[i, 0, v] - going[j, 0, v]
            w1 = going[i, 1, v] - going[j, 1, v]
            w2 = going[i, 2, v] - going[j, 2, v]
            d0 = turns[i, 0, v] + turns[j, 0, v]
            d1 = turns[i, 1, v] + turns[j, 1, v]
            d2 = turns[i, 2, v] + turns[j, 2, v]
            widened = 0.5 * (wider[i // n, v] + wider[j // n, v])
            turned = (u0 * d0 + u1 * d1 + u2 * d2) * per_size
            parted = u0 * w0 + u1 * w1 + u2 * w2 - ahead * turned
            moved = t0 * w0 + t1 * w1 + t2 * w2 + apart * turned
            by_u = (across - turn) * parted + press_wider * widened
            by_t = (along - turn) * moved + shear_wider * widened - bend * (t0 * d0 + t1 * d1 + t2 * d2)
            f0 = turn * w0 + bend * d0 + by_u * u0 + by_t * t0
            f1 = turn * w1 + bend * d1 + by_u * u1 + by_t * t1
            f2 = turn * w2 + bend * d2 + by_u * u2 + by_t * t2
            by[i, 0, v], by[i, 1, v], by[i, 2, v] = by[i, 0, v] + f0, by[i, 1, v] + f1, by[i, 2, v] + f2
            by[j, 0, v], by[j, 1, v], by[j, 2, v] = by[j, 0, v] - f0, by[j, 1, v] - f1, by[j, 2, v] - f2
