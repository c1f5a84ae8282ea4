"""Filters whose result at a time is computed from those at the times before it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Generic, TypeVar

from vtkmuscle.data.pipeline_times import times_of
from vtkmuscle.filters.base.checkpoints import MEGABYTE, Checkpoints
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.base.time_path import input_at, path_to, request_time, requested_time, state_of_inputs

Frame = TypeVar("Frame")


class HistoryFilter(Filter, Generic[Frame]):
    """A filter with a frame per time, which is computed from the frame before it.

    The frame at time t is computed through all time steps that the first moving input announces up to t, and
    t itself, whatever was asked for before. Frames are kept to go back to, in memory of the parameter
    ``checkpoint_memory``, which a subclass declares. In ``execute`` it calls :meth:`frame`; its frames have
    ``nbytes``.
    """

    #: Names of the input ports whose data move with time; the first one's time steps are those of the result.
    moving: ClassVar[tuple[str, ...]]
    checkpoint_memory: Parameter[float]

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.times_from = cls.moving[0]

    def __init__(self, **settings: Any) -> None:
        self._frames: Checkpoints[Frame] = Checkpoints()
        self._made_with: object = None
        self._steps: tuple[float, ...] = ()
        #: How many frames of the path are done, and how many there are.
        self._done = 0, 1
        super().__init__(**settings)

    def settings_of_frames(self) -> dict[str, Any]:
        """Return the parameters that a frame depends on."""
        settings = self.parameters_that_count()
        del settings["checkpoint_memory"]
        return settings

    def forget(self) -> None:
        """Drop all frames: what they were made from has changed."""
        self._frames.clear()

    @property
    def path(self) -> list[float | None]:
        """The times whose frames lead to the one asked for, that one last."""
        return path_to(self.request_time, self._steps)

    def frame(self, given: Sequence[Any], advance: Callable[..., Frame]) -> Frame:
        """Return the frame at the time asked for; those on the way to it that are not kept are computed.

        Parameters
        ----------
        given : sequence
            What the moving ports take of their data, None for an open one.
        advance : callable
            Given the frame before (None at first) and what the moving ports take, returns the next frame.
        """
        path = self.path
        for index in range(self._frames.done(path), len(path)):
            self._done = index, len(path)
            before = self._frames[path[index - 1]] if index else None
            data = [self.data_at(*port, path[index]) for port in zip(self.moving, given, strict=True)]
            self._frames.keep(path[index], advance(before, *data))
            self._thin_out(path[: index + 1])
        self._thin_out(path)
        return self._frames[path[-1]]

    def data_at(self, port: str, given: Any, time: float | None) -> Any:
        """Return what a moving port takes at a time; where there are no time steps what was given."""
        if given is None or time is None or not self._steps:
            return given
        data = input_at(self, self._number_of(port), time)
        if data is None:
            raise RuntimeError(f"{type(self).__name__}: the {port} at time {time:g} could not be computed")
        return self.input_ports[self._number_of(port)].take(data)

    def report_part(self, part: float) -> None:
        """Report which part (0 to 1) of the frame that is being computed is done."""
        done, count = self._done
        self.report_progress((done + part) / count)

    def RequestUpdateExtent(self, request: Any, inInfo: Any, outInfo: Any) -> int:
        """Ask for the moving inputs at the first time whose frame is not known yet.

        The later ones are asked for in :meth:`frame`. VTK's own way, CONTINUE_EXECUTING, is no choice: when
        a filter upstream fails on the way, VTK goes round for ever.
        """
        numbers = [self._number_of(name) for name in self.moving]
        connected = [number for number in numbers if self.GetNumberOfInputConnections(number)]
        made_with = self.settings_of_frames(), state_of_inputs(self, connected)
        if made_with != self._made_with:
            self.forget()
            self._made_with = made_with
        self._steps = times_of(inInfo[numbers[0]].GetInformationObject(0))
        if not self._steps:
            self._frames.clear()
            return 1
        self.request_time = requested_time(outInfo.GetInformationObject(0))
        missing = self.path[self._frames.done(self.path) :]
        for number in connected:
            request_time(inInfo[number].GetInformationObject(0), (missing or self.path[-1:])[0])
        return 1

    def _thin_out(self, path: Sequence[float | None]) -> None:
        """Drop frames for which there is no room; the last two of a path stay, to go on from."""
        nbytes = self._frames[path[-1]].nbytes  # type: ignore[attr-defined]
        memory = MEGABYTE * self.checkpoint_memory
        self._frames.thin(self._steps, path[-2:], nbytes=nbytes, memory=memory)
