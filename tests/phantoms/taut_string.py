"""A taut string in a plane, from end to end round a circle: where it runs and how it pulls."""

from dataclasses import dataclass

import numpy as np

from phantoms.planar import evenly, turned
from vtkmuscle.core.types import Floats


@dataclass(frozen=True)
class String:
    """A taut string past a circle, which it touches where the straight way is not free."""

    start: Floats
    end: Floats
    centre: Floats
    radius: float
    sense: int

    @property
    def wrap(self) -> float:
        """How far round the circle the string lies on it [rad], 0 where it does not."""
        return max(self._free_wrap(), 0.0)

    @property
    def length(self) -> float:
        """Length [mm]: both tangents and the arc between them, or the straight way."""
        if self._free_wrap() <= 0.0:
            return float(np.linalg.norm(self.end - self.start))
        return self._tangent(self.start) + self.radius * self._free_wrap() + self._tangent(self.end)

    @property
    def pull(self) -> Floats:
        """Unit vector (2,) in which the string leaves its end."""
        before = self.start if self._free_wrap() <= 0.0 else self._touch(self.end, -self.sense)
        away: Floats = before - self.end
        return away / np.linalg.norm(away)

    def points(self, spacing: float) -> Floats:
        """Return points (n, 2) on the string, evenly apart by about ``spacing`` [mm], ends included."""
        corners = [self.start[None], self.end[None]]
        if self._free_wrap() > 0.0:
            first = self._touch(self.start, self.sense) - self.centre
            count = max(int(np.ceil(self.wrap * self.radius / spacing)) * 8, 2)
            turns = self.sense * np.linspace(0.0, self.wrap, count)
            corners.insert(1, self.centre + np.array([turned(first, turn) for turn in turns]))
        return evenly(np.vstack(corners), spacing)

    def _free_wrap(self) -> float:
        """Return how far round the points of touch are apart [rad], below 0 where the string is free."""
        a, b = self.start - self.centre, self.end - self.centre
        between = self.sense * (np.arctan2(b[1], b[0]) - np.arctan2(a[1], a[0])) % (2.0 * np.pi)
        return float(between - sum(np.arccos(self.radius / np.linalg.norm(end)) for end in (a, b)))

    def _tangent(self, point: Floats) -> float:
        return float(np.sqrt(np.sum((point - self.centre) ** 2) - self.radius**2))

    def _touch(self, point: Floats, sense: int) -> Floats:
        """Return where the tangent from a point touches the circle, to go on round it in a sense."""
        away = point - self.centre
        distance = np.linalg.norm(away)
        touch: Floats = self.centre + turned(
            away / distance * self.radius, sense * float(np.arccos(self.radius / distance))
        )
        return touch


def lever(point: Floats, pull: Floats) -> float:
    """Return the moment arm -dl/dq [mm] about the origin of a string that pulls a flexing point."""
    return float(pull @ [point[1], -point[0]])
