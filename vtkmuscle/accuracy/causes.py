"""Causes of errors of lengths and moment arms: others of them, and what a difference says."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from vtkmuscle.core.accuracy.estimate import convergence_error, expanded_of_bounds, expanded_of_samples
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.types import Floats

#: What further solves tell of, by the names that a run is asked for them.
KINDS = ("model", "mesh", "slices", "pruning", "landmarks")
#: Those of them that take nothing but the scene.
SOLVED = KINDS[:-1]
#: Orders of convergence: of a muscle's shape in its edges, the lowest there is, since that of position based
#: dynamics is not known; and of fibres in their segments, chords of curves.
MESH_ORDER, SLICES_ORDER = 1.0, 2.0

#: From what is (...) and others of it (n, ...) to an expanded uncertainty (...).
Rule = Callable[[Floats, Floats], Floats]


def _apart(value: Floats, others: Floats) -> Floats:
    """Return how far the one other is off: a difference that is known, and not corrected for."""
    return np.asarray(np.abs(others[0] - value))


#: Per cause, what its other lengths say.
RULES: Mapping[str, Rule] = MappingProxyType(
    {
        "segments": _apart,
        "pruning": _apart,
        "model": lambda value, others: expanded_of_bounds(others[0] - value),
        "mesh": lambda value, others: convergence_error(value, others[0], order=MESH_ORDER),
        "slices": lambda value, others: convergence_error(value, others[0], order=SLICES_ORDER),
        "landmarks": lambda _, others: expanded_of_samples(others),
    }
)


@dataclass(frozen=True, eq=False)
class Cause:
    """A cause, and lengths as they would be without it, or with more of it.

    Attributes
    ----------
    name : str
        A key of :data:`RULES`.
    lengths : sequence of (f, k) arrays
        Of the paths, or of the fibres, in each frame [mm].
    rest : sequence of (k,) arrays
        Of the fibres at rest [mm]; none where the cause has no part in them.
    arms : sequence of dict of str to JointArms
        Of the paths by coordinate, where these are known; else what lengths say of them.
    """

    name: str
    lengths: Sequence[Floats]
    rest: Sequence[Floats] = ()
    arms: Sequence[Mapping[str, JointArms]] = ()

    def part(self, of: Callable[[Floats], Floats], value: Floats, lengths: Sequence[Floats]) -> Floats:
        """Return the part of the error of a quantity that is made of lengths.

        Parameters
        ----------
        of : callable
            From lengths to the quantity.
        value : array
            The quantity.
        lengths : sequence of array
            ``lengths`` or ``rest``.
        """
        return RULES[self.name](value, np.array([of(other) for other in lengths]))
