"""Frames kept to go back to, as many as there is memory for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Generic, TypeVar

Frame = TypeVar("Frame")

#: [bytes]
MEGABYTE = 10**6


class Checkpoints(Generic[Frame]):
    """Frames by time, thinned out evenly where memory is short.

    Kept are the frames whose number on the path is a multiple of a stride. When memory is used up the stride
    doubles. So with room for k frames, going back to one of n costs at most 2 n / k steps. The frame of the
    last request and the one before it are kept in any case: to play on never starts anew, also after a
    request between two time steps.
    """

    def __init__(self) -> None:
        self._frames: dict[float | None, Frame] = {}
        self._stride = 1

    def __len__(self) -> int:
        return len(self._frames)

    def __contains__(self, time: float | None) -> bool:
        return time in self._frames

    def __getitem__(self, time: float | None) -> Frame:
        return self._frames[time]

    def done(self, path: Sequence[float | None]) -> int:
        """Return how much of a path is done: one more than the index of its last frame that is kept."""
        return max((i + 1 for i, time in enumerate(path) if time in self._frames), default=0)

    def clear(self) -> None:
        """Forget all frames."""
        self._frames.clear()
        self._stride = 1

    def keep(self, time: float | None, frame: Frame) -> None:
        """Keep the frame of a time."""
        self._frames[time] = frame

    def thin(
        self, steps: Sequence[float], last: Sequence[float | None], *, nbytes: int, memory: float
    ) -> None:
        """Drop frames until the others fit into memory.

        Parameters
        ----------
        steps : sequence of float
            All time steps, in order. Frames of other times go first: nothing is computed from them.
        last : sequence of float or None
            Times whose frames are kept in any case, and not counted.
        nbytes : int
            Memory that a frame takes [bytes].
        memory : float
            What there is [bytes].
        """
        number: dict[float | None, int] = {time: i for i, time in enumerate(steps)}
        while True:
            others = [time for time in self._frames if time not in last]
            if len(others) * nbytes <= memory:
                return
            if nbytes > memory:
                drop = others
            else:
                drop = [time for time in others if time not in number or number[time] % self._stride]
            if not drop:
                self._stride *= 2
            for time in drop:
                del self._frames[time]
