"""The base of filters: declarations, errors, connections, time."""

import inspect
import math

import numpy as np
import pytest
import pyvista as pv
from commands import python
from vtkmodules.vtkCommonCore import vtkObject
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkFiltersCore import vtkCleanPolyData
from vtkmodules.vtkFiltersSources import vtkLineSource
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

from vtkmuscle.data.arrays import points_of, with_points
from vtkmuscle.data.pipeline_times import times_of
from vtkmuscle.filters.base.algorithm import AbortedError
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.base.ports import InputPort, OutputPort


class Shift(Filter):
    """Move points.

    Some prose.

    References
    ----------
    Someone 2000, doi:10.1000/1.
    """

    vector = Parameter(tuple, default=(1.0, 0.0, 0.0), length=3, units="mm", doc="How far.")
    times = Parameter(int, default=1, minimum=0, maximum=9, doc="How often.")
    way = Parameter(str, default="there", choices=("there", "back"), doc="Which way.")
    limit: Parameter[float | None] = Parameter(float, default=None, above=0.0, doc="Farthest point.")

    shape = InputPort(vtkPolyData, doc="Points.")
    extra = InputPort(vtkPolyData, optional=True, doc="More points.")
    output = OutputPort(vtkPolyData, doc="The points, moved.")

    def execute(self, shape, extra):
        if self.limit is not None and np.abs(points_of(shape)).max() > self.limit:
            raise ValueError(f"Shift: shape: a point is farther than {self.limit:g}")
        sign = 1 if self.way == "there" else -1
        steps = self.times + (0 if extra is None else extra.GetNumberOfPoints())
        return with_points(shape, points_of(shape) + sign * steps * np.array(self.vector))


class Clock(Filter):
    """Give the time asked for."""

    output = OutputPort(vtkPolyData, doc="One point, x the time.")

    def time_steps(self, inputs_information):
        return (0.0, 0.5, 2.0)

    def execute(self):
        return line(-1.0 if self.request_time is None else self.request_time)


def line(x=0.0):
    source = vtkLineSource(point1=(x, 0, 0), point2=(x, 0, 5))
    source.Update()
    return source.GetOutput()


def x_of(data):
    return points_of(data)[0, 0]


# -------------------------------------------------------------------- declarations


def test_constructor_arguments_are_ports_and_parameters():
    shift = Shift(times=3, vector=(0, 2, 0))
    assert shift.parameters() == {"vector": (0.0, 2.0, 0.0), "times": 3, "way": "there", "limit": None}
    names = ["shape", "extra", "vector", "times", "way", "limit"]
    assert list(inspect.signature(Shift).parameters) == names


def test_representation_shows_the_state():
    assert repr(Shift(times=2)) == "Shift(vector=(1.0, 0.0, 0.0), times=2, way='there', limit=None)"


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("times", 10, "an integer >= 0 and <= 9"),
        ("times", 1.0, "an integer >= 0 and <= 9"),
        ("times", True, "an integer >= 0 and <= 9"),
        ("times", None, "an integer >= 0 and <= 9"),
        ("way", "up", "one of 'there', 'back'"),
        ("vector", (1, 2), "3 finite numbers"),
        ("vector", (1, 2, float("nan")), "3 finite numbers"),
        ("vector", "abc", "3 finite numbers"),
        ("limit", 0, "a finite number > 0 or None"),
        ("limit", float("inf"), "a finite number > 0 or None"),
    ],
)
def test_bad_value_is_refused_with_name_value_and_what_is_allowed(name, value, allowed):
    for set_it in (lambda: Shift(**{name: value}), lambda: setattr(Shift(), name, value)):
        with pytest.raises(ValueError, match="Shift") as caught:
            set_it()
        assert str(caught.value) == f"Shift: {name} is {value!r}, but must be {allowed}"


@pytest.mark.parametrize(
    ("name", "value", "kept"),
    [
        ("times", np.int32(4), 4),
        ("limit", 3, 3.0),
        ("limit", np.float32(0.5), 0.5),
        ("vector", np.arange(3), (0.0, 1.0, 2.0)),
        ("vector", [1, 2, 3], (1.0, 2.0, 3.0)),
        ("way", np.str_("back"), "back"),
    ],
)
def test_values_are_kept_as_plain_python(name, value, kept):
    found = getattr(Shift(**{name: value}), name)
    assert found == kept
    assert type(found) is type(kept)


def test_parameters_are_inherited_and_may_be_declared_anew():
    class FarShift(Shift):
        """Move points farther."""

        times = Parameter(int, default=5, minimum=5, doc="How often.")

    assert FarShift().times == 5
    assert FarShift().way == "there"
    assert list(FarShift.parameter_declarations) == ["vector", "times", "way", "limit"]
    with pytest.raises(ValueError, match=r"FarShift: times"):
        FarShift(times=1)


@pytest.mark.parametrize("name", ["progress", "information", "update", "apply", "parameters", "debug"])
def test_names_that_vtk_owns_are_refused(name):
    with pytest.raises(TypeError, match=name):
        type("Bad", (Filter,), {name: Parameter(int, default=1, doc="Bad.")})


# -------------------------------------------------------------------- connections


def test_results_are_copies_that_later_updates_do_not_change():
    shift = Shift()
    first = shift.apply(line(1.0))
    second = shift.apply(line(2.0))
    assert (x_of(first), x_of(second)) == (2.0, 3.0)
    assert isinstance(first, pv.PolyData)


def test_imports_and_updates_leave_vtk_and_pyvista_as_they_are():
    script = """
import signal, sys
import pyvista
from vtkmodules.util import execution_model
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkObject
pipeline, finders, kept = execution_model.Pipeline, list(sys.meta_path), {
    kind: set(vars(kind)) for kind in (pyvista.DataSet, pyvista.MultiBlock, pyvista.DataObject)}
signal.signal(signal.SIGINT, signal.default_int_handler)
from vtkmuscle.filters import FibreTemplateSource
def state():
    return signal.getsignal(signal.SIGINT), vtkObject.GetGlobalWarningDisplay()
before, within = state(), []
class Failing(FibreTemplateSource):
    def execute(self):
        within.append(state())
        raise ValueError
for source in (FibreTemplateSource(n_fibres=3), Failing()):
    source.AddObserver("ProgressEvent", lambda *_: within.append(state()))
    try:
        source.update()
    except ValueError:
        within.append(state())
assert len(within) > 3 and set(within) == {before}
assert execution_model.Pipeline is pipeline
assert all(set(vars(kind)) == names for kind, names in kept.items())
assert set(sys.meta_path) == set(finders)
"""
    python("-c", script)


# -------------------------------------------------------------------- errors


def test_error_upstream_comes_through_vtks_own_filters():
    far = Shift(limit=2.0, shape=line())
    chain = far >> vtkCleanPolyData() >> Shift()
    for _ in range(2):
        with pytest.raises(ValueError, match="farther than 2"):
            chain.last.update()
        with pytest.raises(ValueError, match="farther than 2"):
            chain.last.apply()


def test_failure_of_a_vtk_algorithm_upstream_is_an_error(tmp_path):
    reader = vtkXMLPolyDataReader(file_name=str(tmp_path / "no such file.vtp"))
    shift = Shift(shape=reader)
    vtkObject.GlobalWarningDisplayOff()
    try:
        with pytest.raises((RuntimeError, ValueError), match="Shift"):
            shift.update()
    finally:
        vtkObject.GlobalWarningDisplayOn()


def test_a_failure_is_raised_by_update_and_shown_by_vtks_own(caplog, capfd):
    shift = Shift(limit=2.0, shape=line())
    with pytest.raises(ValueError, match="farther"):
        shift.update()
    with pytest.raises(ValueError, match="is not connected"):
        (Shift() >> vtkCleanPolyData()).update()
    assert (caplog.text, capfd.readouterr().err) == ("", "")
    assert not shift.Update()
    assert "returned failure for request" in caplog.text  # PyVista has VTK's output logged


# -------------------------------------------------------------------- progress, abort, time


def test_progress_never_goes_back():
    class Restless(Shift):
        """Reports back and forth."""

        def execute(self, shape, extra):
            for fraction in (0.2, 0.6, 0.4, 7.0):
                self.report_progress(fraction)
            return shape

    seen = []
    restless = Restless(shape=line())
    restless.AddObserver("ProgressEvent", lambda caller, _: seen.append(caller.GetProgress()))
    for _ in range(2):
        seen.clear()
        restless.Modified()
        restless.update()
        assert seen == sorted(seen)
        assert {0.2, 0.6, 1.0} <= set(seen)


def test_abort_upstream_is_told_downstream():
    first = Shift(shape=line())
    first.SetAbortExecute(1)
    chain = first >> Shift()
    with pytest.raises(AbortedError):
        chain.last.update()
    assert x_of(chain.last.update().output) == 2.0


def test_time_is_asked_for_and_told():
    clock = Clock()
    clock.UpdateInformation()
    information = clock.GetOutputInformation(0)
    assert times_of(information) == (0.0, 0.5, 2.0)
    key = vtkStreamingDemandDrivenPipeline.TIME_RANGE()
    assert (information.Get(key, 0), information.Get(key, 1)) == (0.0, 2.0)
    for time in (0.5, 2.0, 0.5, 1.25):
        output = clock.update(time=time).output
        assert x_of(output) == time
        assert output.GetInformation().Get(vtkDataObject.DATA_TIME_STEP()) == time
        assert x_of(clock.apply(time=time)) == time


def test_a_time_beyond_those_that_there_are_is_said():
    for time in (-0.5, 2.5):
        with pytest.warns(UserWarning, match=rf"Clock: time {time:g} is outside of the motion, 0 to 2"):
            Clock().update(time=time)


@pytest.mark.parametrize("time", [math.nan, math.inf])
def test_a_time_that_is_not_finite_is_refused(time):
    with pytest.raises(ValueError, match=f"Clock: the time is {time}, but must be finite"):
        Clock().update(time)
