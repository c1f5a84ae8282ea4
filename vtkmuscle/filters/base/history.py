"""Filters whose result at a time is computed from those before it, with the frames that they keep."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Generic, TypeVar

from vtkmuscle.data.pipeline_times import input_at, request_time, requested_time, state_of_inputs, times_of
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.parameters import Parameter

Frame = TypeVar("Frame")

#: [bytes]
MEGABYTE = 10**6


class Checkpoints(Generic[Frame]):
    """Frames by time, thinned out evenly where memory is short.

    The frames whose number on the path is a multiple of a stride are kept. When memory is used up the stride
    doubles. So with room for k frames, going back to one of n costs at most 2 n / k steps. The frame of the
    last request and the one before it are always kept: playing on never starts anew, even after a request
    between two time steps.
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
        """Return one more than the index on a path of its last frame that is kept, 0 where none is."""
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
        """Drop frames of `nbytes` each until they fit into `memory` [bytes].

        `steps` are all time steps, in order. Frames of other times go first: nothing is computed from them.
        The frames of the times `last` are kept in any case, and not counted.
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


class HistoryFilter(Filter, Generic[Frame]):
    """A filter with a frame per time, which is computed from the frame before it.

    The frame at time t is computed through all time steps that the first moving input announces up to t, and
    t itself, whatever was asked for before. Frames are kept to go back to, in memory of the parameter
    ``checkpoint_memory``, which a subclass declares; they have ``nbytes``. The subclass calls :meth:`frame`
    in ``execute``.
    """

    #: Names of the input ports whose data move with time; the first one's time steps are those of the result.
    moving: ClassVar[tuple[str, ...]]
    checkpoint_memory: Parameter[float]

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.times_from = cls.moving[0]

    def __init__(self, **settings: Any) -> None:
        self._frames: Checkpoints[Frame] = Checkpoints()
        #: The settings, the filter's modification time when they were read, and the state of moving inputs.
        self._settings: tuple[int, dict[str, Any]] = 0, {}
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
        """Drop all frames: their inputs have changed."""
        self._frames.clear()

    @property
    def path(self) -> list[float | None]:
        """The times whose frames lead to the one asked for, that one last; [None] without time steps."""
        time = self.request_time
        return [time] if time is None else [*(step for step in self._steps if step < time), time]

    def frame(self, given: Sequence[Any], advance: Callable[..., Frame]) -> Frame:
        """Return the frame at the time asked for; missing ones on the way to it are computed.

        `given` are the arguments of ``execute`` for the moving ports, None for an open one. `advance` is
        called with the frame before (None at first) and the moving arguments, and returns the next frame.
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
        """Return the argument for a moving port at a time; `given` itself where there are no time steps."""
        if given is None or time is None or not self._steps:
            return given
        number = self._number_of(port)
        data = input_at(self, number, time)
        if data is None:
            raise RuntimeError(f"{type(self).__name__}: the {port} at time {time:g} could not be computed")
        return self._argument(number, data)

    def report_part(self, part: float) -> None:
        """Report which part (0 to 1) of the frame that is being computed is done."""
        done, count = self._done
        self.report_progress((done + part) / count)

    def RequestUpdateExtent(self, request: Any, inInfo: Any, outInfo: Any) -> int:
        """Ask for the moving inputs at the first time whose frame is not known yet.

        The later ones are asked for in :meth:`frame`. VTK's own way, CONTINUE_EXECUTING, will not do: when
        a filter upstream fails on the way, VTK repeats the request for ever.
        """
        numbers = [self._number_of(name) for name in self.moving]
        connected = [number for number in numbers if self.GetNumberOfInputConnections(number)]
        if self._settings[0] != self.GetMTime():
            self._settings = self.GetMTime(), self.settings_of_frames()
        made_with = self._settings[1], state_of_inputs(self, connected)
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
