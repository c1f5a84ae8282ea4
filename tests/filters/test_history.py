"""Filters over time: which frames are computed, which are kept, and when they are forgotten."""

from dataclasses import dataclass

import numpy as np
import pytest
from test_pbd_deformer import bones, spindle
from vtkmodules.vtkCommonCore import vtkWeakReference
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkAppendPolyData, vtkCleanPolyData

from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.data.arrays import add_arrays, field_array, points_of, surface_from, with_points
from vtkmuscle.filters import BoneMotion, PBDDeformer
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.history import HistoryFilter
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.base.ports import InputPort, OutputPort


@dataclass(frozen=True)
class Total:
    value: float
    nbytes: int = 1_000_000


class Clock(Filter):
    """Give a triangle whose first corner is at x = time."""

    output = OutputPort(vtkPolyData, doc="The triangle.")

    def time_steps(self, _):
        return [0.0, 1.0, 2.0, 3.0]

    def execute(self):
        return surface_from(
            np.array([[self.request_time, 0, 0], [0, 1, 0], [0, 0, 1.0]]), np.array([[0, 1, 2]])
        )


class Sum(HistoryFilter[Total]):
    """Add up x of the first corner over the times."""

    checkpoint_memory = Parameter(float, default=100.0, minimum=0.0, units="MB", doc="Memory for frames.")
    shape = InputPort(vtkPolyData, doc="The triangle.")
    output = OutputPort(vtkPolyData, doc="The triangle, with the field array ``Sum``.")
    moving = ("shape",)

    def execute(self, shape):
        result = with_points(shape, points_of(shape))
        add_arrays(result, fields={"Sum": self.frame((shape,), self._add).value})
        return result

    def _add(self, before, shape):
        x = float(points_of(shape)[0, 0])
        seen.append(x)
        return Total(x + (before.value if before else 0.0))


seen: list[float] = []


@pytest.fixture
def total():
    seen.clear()
    return Sum(shape=Clock())


def sum_at(total, time):
    return float(field_array(total.update(time).output, "Sum")[0])


def test_frames_are_kept_and_a_time_between_steps_goes_on_from_the_step_before(total):
    sum_at(total, 3.0)
    seen.clear()
    assert sum_at(total, 1.0) == 1.0
    assert sum_at(total, 2.5) == 5.5
    assert seen == [2.5]


@pytest.mark.parametrize("order", [1, -1])
def test_another_filter_of_the_same_source_has_no_part_in_frames_and_its_own_time(total, order):
    append, copy = vtkAppendPolyData(), vtkCleanPolyData(input_connection=total.shape.GetOutputPort())
    for source in (total, copy)[::order]:
        append.AddInputConnection(source.GetOutputPort())
    append.UpdateTimeStep(3.0)
    assert seen == [0.0, 1.0, 2.0, 3.0]
    assert points_of(append.GetOutput())[::3, 0].tolist() == [3.0, 3.0]


@pytest.mark.filterwarnings("ignore:.* is outside of the motion")
def test_a_time_beyond_the_steps_has_the_frame_of_the_nearest_end(total):
    """Another step to the same pose had moved a surface by 0.6 mm."""
    assert [sum_at(total, time) for time in (9.0, -1.0)] == [6.0, 0.0]
    assert seen == [0.0, 1.0, 2.0, 3.0]


def test_progress_goes_up_to_the_whole_over_all_frames(total):
    parts = []

    class Reporting(Sum):
        def _add(self, before, shape):
            self.report_part(0.5)
            parts.append(self.GetProgress())
            return super()._add(before, shape)

    sum_at(Reporting(shape=Clock()), 3.0)
    assert parts == [0.125, 0.375, 0.625, 0.875]


def test_data_on_the_way_are_freed_before_the_update_ends():
    moved, alive = [], []

    class Observed(BoneMotion):
        """Keep weak references to its results."""

        def execute(self, bones):
            alive.append(sum(result.Get() is not None for result in moved))
            result = super().execute(bones)
            for data in (result, result.GetBlock(1)):
                moved.append(vtkWeakReference())
                moved[-1].Set(data)
            return result

    steps = [2.0 * step for step in range(12)]
    moving = Observed(bones=bones(), motion=hinge("upper", (0.0, 25.0, 0.0), (1, 0, 0), steps))
    PBDDeformer(muscle=spindle(), rest_bones=bones(), bones=moving, iterations=1).update(steps[-1])
    assert len(alive) == 1 + len(steps), "at the requested time, then at each step"
    assert max(alive) <= 2
