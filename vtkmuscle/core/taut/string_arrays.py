"""What the kernel that pulls strings is given, and works with."""

from __future__ import annotations

from typing import NamedTuple

from vtkmuscle.core.types import Bools, Floats, Ints, Table


class Fields(NamedTuple):
    """Distances from the bones, as of :class:`~vtkmuscle.core.taut.bone_fields.BoneFields`.

    Attributes
    ----------
    to_axes : (b, 4, 4) array
        From the scene at rest to the axes of each bone's field.
    layout : (b, 8) array
    table : (t,) int32 array
    values : (v, 9, 9, 9) array
    """

    to_axes: Floats
    layout: Floats
    table: Table
    values: Floats


class Tissue(NamedTuple):
    """What lies between fibres and bones at rest.

    Attributes
    ----------
    track : (f, n, 3) array
        The fibres at rest [mm].
    thickness : (b, f, n) array
        Of the tissue between each point of a track and each bone [mm].
    within : (b, f) array
        How near a string comes to a bone before anything is asked of it [mm]; -inf where nothing ever is.
    guide : (b, f, n) array
        How firmly a string is kept on its track at each point of it: 0 for not at all, 1 for
        :data:`~vtkmuscle.core.taut.strings.HOLD`.
    aside : (b, f, n, 3) array
        Unit direction aside of the track over the bone.
    guided : (b, f) bool array
        Where any ``guide`` is more than 0.
    hold : float
        How far off the tissue below a string is from the bone when the guide lets go [mm].
    """

    track: Floats
    thickness: Floats
    within: Floats
    guide: Floats
    aside: Floats
    guided: Bools
    hold: float


class Memory(NamedTuple):
    """What is known of strings' points from the pose before; it saves iterations.

    Attributes
    ----------
    place : (b, f, n) int array
        Segment of the track over each bone that a point is nearest to.
    pushed : (b, f, n) bool array
        Which bones push which points.
    """

    place: Ints
    pushed: Bools


class Work(NamedTuple):
    """Working memory for one string of n points.

    Attributes
    ----------
    gap : (b, n) array
        How far each point is from where each bone pushes [mm].
    away : (b, n) array
        How far each point may go before that bone is asked again [mm].
    normal : (b, n, 3) array
        Direction in which a bone pushes.
    pressure : (b, n) array
        How hard it did in the iteration before.
    used : (b, n) bool array
        Whether the bone's spring is in the equations.
    matrices, right : (n, 6) array, (n, 3) array
        The equations of :func:`~vtkmuscle.core.taut.springs.solve`.
    solved, last : (n, 3) arrays
        Their solution [mm], and how the points went in the iteration before [mm].
    held : (r, 5) array
        As of :func:`~vtkmuscle.core.taut.ring_contact.hold_in_ring`.
    vectors : (4, 3) array
        Anything.
    """

    gap: Floats
    away: Floats
    normal: Floats
    pressure: Floats
    used: Bools
    matrices: Floats
    right: Floats
    solved: Floats
    last: Floats
    held: Floats
    vectors: Floats
