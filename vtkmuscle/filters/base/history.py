"""Filters whose result depends on earlier times, with stored frames."""

from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Generic, TypeVar

from vtkmuscle.data.pipeline_times import input_at, request_time, requested_time, state_of_inputs, times_of
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.parameters import Parameter

Frame = TypeVar("Frame")
#: Time of a frame; None without time steps.
Time = float | None
#: Unit of ``checkpoint_memory`` [bytes].
MEGABYTE = 10**6


def thin(frames: dict[Time, Any], steps: Sequence[float], path: Sequence[Time], memory: float) -> None:
    """Drop frames, by time, until they fit into `memory` [bytes].

    Frames whose index is a multiple of a stride are kept; the stride is the least power of two that fits into
    memory. With room for k of n frames, going back costs at most 2 n / k steps. `steps` are all time steps,
    in order. Frames between steps go first, because no other frame depends on them. The last two frames of a
    path are kept, and not counted, so that playing on never restarts.
    """
    last, nbytes, stride = path[-2:], frames[path[-1]].nbytes, 1
    while len(droppable := frames.keys() - last) * nbytes > memory:
        number: dict[Time, int] = {time: i for i, time in enumerate(steps)}
        for time in droppable:
            if nbytes > memory or number.get(time, 0.5) % stride:
                del frames[time]
        stride *= 2


class HistoryFilter(Filter, Generic[Frame]):
    """A filter that computes each frame from the frame before.

    The frame at time t is computed through all time steps of the first moving input up to t, then at t,
    whatever was requested before. Frames (with ``nbytes``) are stored within the memory of the parameter
    ``checkpoint_memory``, declared by the subclass. The subclass calls :meth:`frame` in ``execute``.
    """

    #: Input ports with moving data; the first port has the time steps of the result.
    moving: ClassVar[tuple[str, ...]]
    #: Parameters that do not affect a frame.
    without_effect: ClassVar[tuple[str, ...]] = ("checkpoint_memory",)
    checkpoint_memory: Parameter[float]

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.times_from = cls.moving[0]

    def __init__(self, **settings: Any) -> None:
        self._frames: dict[Time, Frame] = {}
        self._made_with: object = None
        self._steps: tuple[float, ...] = ()
        #: Number of finished frames of the path, and of all.
        self._done = 0, 1
        super().__init__(**settings)

    @property
    def path(self) -> list[Time]:
        """Times of the frames up to the requested time. [None] without steps."""
        time, steps = self.request_time, self._steps
        if time is None or not steps:
            return [time]
        time = min(max(time, steps[0]), steps[-1])
        return [*(step for step in steps if step < time), time]

    def frame(self, arguments: Sequence[Any], advance: Callable[..., Frame]) -> Frame:
        """Return the frame at the requested time, computing missing frames.

        `arguments` are the arguments of ``execute`` for the moving ports, None for an open port. `advance`
        takes the frame before (None at first) and the moving arguments, and returns the next frame.
        """
        path, memory = self.path, MEGABYTE * self.checkpoint_memory
        first = self._n_stored(path)
        for index in range(first, len(path)):
            self._done = index, len(path)
            before, data = self._frames[path[index - 1]] if index else None, arguments
            if index > first or path[index] != self.request_time:
                data = [self.data_at(*port, path[index]) for port in zip(self.moving, arguments, strict=True)]
            self._frames[path[index]] = advance(before, *data)
            thin(self._frames, self._steps, path[: index + 1], memory)
        thin(self._frames, self._steps, path, memory)
        return self._frames[path[-1]]

    def data_at(self, port: str, argument: Any, time: float | None) -> Any:
        """Return a moving port's argument at a time; `argument` without time steps."""
        if argument is None or time is None or not self._steps:
            return argument
        number = self._number_of(port)
        return self._argument(number, input_at(self, number, time))

    def report_part(self, part: float) -> None:
        """Report the finished part (0 to 1) of the current frame."""
        done, count = self._done
        self.report_progress((done + part) / count)

    def RequestUpdateExtent(self, request: Any, inInfo: Any, outInfo: Any) -> int:
        """Request the moving inputs at the requested time; forget frames after a change.

        :meth:`frame` requests earlier times. Another request here would be that of all filters with the same
        source. VTK's CONTINUE_EXECUTING would repeat the request for ever after a failure upstream.
        """
        numbers = [self._number_of(name) for name in self.moving]
        connected = [number for number in numbers if self.GetNumberOfInputConnections(number)]
        settings = self.parameters_that_count().items()
        counting = {name: value for name, value in settings if name not in self.without_effect}
        made_with = counting, state_of_inputs(self, connected)
        if made_with != self._made_with:
            self._frames.clear()
            self._made_with = made_with
        self._steps = times_of(inInfo[numbers[0]].GetInformationObject(0))
        if not self._steps:
            self._frames.clear()
            return 1
        self.request_time = requested_time(outInfo.GetInformationObject(0))
        for number in connected:
            request_time(inInfo[number].GetInformationObject(0), self.request_time)
        return 1

    def _n_stored(self, path: Sequence[Time]) -> int:
        """Return the index after a path's last stored frame."""
        return next((i for i in range(len(path), 0, -1) if path[i - 1] in self._frames), 0)
