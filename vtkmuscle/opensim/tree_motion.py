"""The rigid motion of bones on a kinematic tree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.blending import screws
from vtkmuscle.core.motion.coordinates import TRANSLATIONS, Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion, inverses
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.opensim.tree import KinematicTree

#: Half of the step by which it is found how a coordinate moves bones [rad, or its unit]: central differences
#: of sines err by a sixth of its square, and rounding of positions by a millionth of that of lengths.
_STEP = 1e-4


def motion_of_tree(
    tree: KinematicTree,
    values: Mapping[str, ArrayLike],
    *,
    times: ArrayLike,
    bodies: Mapping[str, str],
    frame: str | None = None,
    fixed: str | None = None,
    coordinates: Sequence[str] | None = None,
) -> RigidMotion:
    """Return how bones move with the bodies of a tree, from rest to the coordinates' values.

    Parameters
    ----------
    tree : KinematicTree
        Whose coordinates are at rest where they have their ``rest``.
    values : mapping of str to (f,) array_like
        Of coordinates, in their units.
    times : (f,) array_like
        Ascending.
    bodies : mapping of str to str
        The body of each bone.
    frame : str, optional
        The body whose frame at rest is that in which the bones are given; default the root.
    fixed : str, optional
        The body that stays where it is; default the root.
    coordinates : sequence of str, optional
        Those that moment arms are taken by; default all that move one of the bones against another one, or
        against the fixed body.

    Returns
    -------
    RigidMotion
        Of the bones that move at all; angles of its coordinates are in degrees.

    Raises
    ------
    ValueError
        If there is no such body or coordinate, or a value is not finite.
    """
    for body in (*bodies.values(), frame or tree.root, fixed or tree.root):
        if body not in tree.bodies:
            raise InputError("", f"there is no body {body!r}; {suggestion(body, tree.bodies)}")
    free = tree.crossed([*bodies.values(), fixed or tree.root])
    chosen = [name for name in free if name in values] if coordinates is None else list(coordinates)
    full = tree.completed(values)
    for name in chosen:
        tree.coordinate(name)  # raises where there is none
    rest = tree.poses({})
    held = fixed or tree.root
    placed = rest[frame or tree.root][0]
    back = inverses(placed[None])[0]

    def moved(at: Mapping[str, ArrayLike]) -> dict[str, Floats]:
        """Return the motion of each bone from rest, (f, 4, 4)."""
        now = tree.poses(at)
        hold = rest[held] @ inverses(now[held])
        return {
            bone: back @ hold @ now[body] @ inverses(rest[body]) @ placed for bone, body in bodies.items()
        }

    joints = {joint.child: joint for joint in tree.joints}
    transforms: dict[str, Floats] = {}
    centres: dict[str, Floats] = {}
    for bone, motion in moved(full).items():
        body = bodies[bone]
        if np.abs(motion - np.eye(4)).max() <= 1e-12 * max(1.0, float(np.abs(placed[:3, 3]).max())):
            continue
        transforms[bone] = motion
        if body in joints:
            in_body = joints[body].child_frame
            centres[bone] = (back @ rest[body][0] @ in_body)[:3, 3]
    own = {name: full[name] for name in tree.free}

    def twists(name: str, factor: float) -> dict[str, Floats] | None:
        """Return how a coordinate moves each bone, per radian or millimetre, of which it has `factor`."""
        if name not in own:
            return None
        low, high = (moved({**own, name: own[name] + step}) for step in (-_STEP, _STEP))
        return {bone: screws(high[bone] @ inverses(low[bone])) / (2.0 * _STEP * factor) for bone in bodies}

    kinds = {name: tree.coordinate(name) for name in chosen}
    found = {
        name: Coordinate(
            np.degrees(full[name]) if kind.is_angle else full[name],
            "deg" if kind.is_angle else kind.unit,
            kind.positive or "",
            twists(name, 1.0 if kind.is_angle else TRANSLATIONS[kind.unit]),
        )
        for name, kind in kinds.items()
    }
    return RigidMotion(np.asarray(times, dtype=np.float64), transforms, centres, found)


def grid_of(axes: Mapping[str, Floats]) -> dict[str, Floats]:
    """Return all poses of a grid of coordinates, each next to the one before it.

    Parameters
    ----------
    axes : mapping of str to (k,) array
        Values of each coordinate.

    Returns
    -------
    dict of str to (f,) array
        By coordinate. The last one changes first, there and back in turn, so that no step is longer than
        one of the grid.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.opensim.tree_motion import grid_of
    >>> found = grid_of({"hip": np.array([0.0, 1.0]), "knee": np.array([0.0, 1.0, 2.0])})
    >>> found["knee"].tolist()
    [0.0, 1.0, 2.0, 2.0, 1.0, 0.0]
    """
    sizes = [len(values) for values in axes.values()]
    rows = np.array(list(product(*(range(size) for size in sizes))), dtype=np.int64)
    for column in range(1, len(sizes)):
        # Which way a coordinate goes depends on how many turns those before it have made.
        block = int(np.prod(sizes[column:]))
        back = (np.arange(len(rows)) // block) % 2 == 1
        rows[back, column] = sizes[column] - 1 - rows[back, column]
    return {name: values[rows[:, column]] for column, (name, values) in enumerate(axes.items())}
