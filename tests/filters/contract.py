"""What every filter must do when it runs, as functions of a case that raise an AssertionError otherwise.

DESIGN's contract, points 2 to 6 and 9; :mod:`contract_declarations` has the others, which concern what a
filter declares. :mod:`test_contract` runs :data:`CHECKS` over all filters, :mod:`test_guide_filter` over the
filter of a page.
"""

import gc
import weakref
from contextlib import contextmanager
from copy import copy

import contract_declarations
import numpy as np
import pytest
from filter_case import (
    PassOn,
    count_executions,
    digest,
    digests,
    is_empty,
    leaves,
    other_value,
    poisoned,
    results_digests,
    values_of,
)
from vtkmodules.vtkCommonCore import VTK_DOUBLE, vtkObject, vtkWeakReference
from vtkmodules.vtkCommonExecutionModel import vtkTrivialProducer
from vtkmodules.vtkFiltersGeometry import vtkCompositeDataGeometryFilter

import vtkmuscle
from examples import OBJECTS, TIMES, example
from vtkmuscle.data.arrays import add_arrays, points_of
from vtkmuscle.data.pipeline_times import provenance_array, provenance_of
from vtkmuscle.filters.base.algorithm import AbortedError
from vtkmuscle.plotting import can_render

# -------------------------------------------------------------------- 2 data


def check_inputs_are_unchanged(case):
    inputs = case.inputs()
    before = [digest(data) for data in inputs]
    case.filter(*inputs).update()
    for port, data, hashed in zip(case.ports, inputs, before, strict=True):
        assert digest(data) == hashed, f"the input {port.name} was changed"


def check_other_arrays_pass_through(case):
    """Arrays of the first input reach the output: point and cell arrays where points and cells are kept.

    An output of another kind (attachments made from a muscle) is not that data set changed, but a new one.
    """
    inputs = case.inputs()
    marked = leaves(inputs[0]) if inputs else ()
    for leaf in marked:
        add_arrays(
            leaf,
            points={"OfPoints": np.arange(leaf.GetNumberOfPoints(), dtype=np.float32)},
            cells={"OfCells": np.arange(3 * leaf.GetNumberOfCells()).reshape(-1, 3)},
            fields={"OfAll": np.array([1.5, 2.5])},
        )
    output = case.filter(*inputs).update().output
    if not inputs or not isinstance(output, type(inputs[0])):
        pytest.skip("makes another kind of data than it takes")
    for before, after in zip(marked, leaves(output), strict=True):
        kept = [(before.GetFieldData(), after.GetFieldData(), "OfAll")]
        if after.GetNumberOfPoints() == before.GetNumberOfPoints():
            kept.append((before.GetPointData(), after.GetPointData(), "OfPoints"))
        if after.GetNumberOfCells() == before.GetNumberOfCells():
            kept.append((before.GetCellData(), after.GetCellData(), "OfCells"))
        for source, target, name in kept:
            assert target.HasArray(name), f"the array {name} of the input is lost"
            old, new = source.GetAbstractArray(name), target.GetAbstractArray(name)
            assert np.array_equal(values_of(old), values_of(new)), f"the array {name} is not what it was"


def check_provenance_travels(case):
    """The output says which filters made it, with their parameters: those of all inputs, and this one."""
    inputs = case.inputs()
    for number, data in enumerate(inputs):
        data.GetFieldData().AddArray(provenance_array([], f"Earlier{number}", {"value": number}))
    algorithm = case.filter(*inputs)
    output = algorithm.update().output
    steps = provenance_of(output)
    assert [step["filter"] for step in steps[:-1]] == [f"Earlier{n}" for n in range(len(inputs))]
    assert steps[-1]["filter"] == case.kind.__name__
    assert steps[-1]["vtkmuscle"] == vtkmuscle.__version__
    assert list(steps[-1]["parameters"]) == list(case.declarations)
    for name, value in steps[-1]["parameters"].items():
        given = getattr(algorithm, name)
        if type(given) not in OBJECTS:
            assert value == (list(given) if isinstance(given, tuple) else given), f"{name} is {value!r}"
    for number, data in enumerate(inputs):
        assert len(provenance_of(data)) == 1, f"the input {number} was changed"


def check_outputs_are_finite_doubles(case):
    for leaf in leaves(case.filter(*case.inputs()).update().output):
        assert leaf.GetPoints().GetDataType() == VTK_DOUBLE, "the points are not double precision"
        assert np.isfinite(points_of(leaf)).all()


# -------------------------------------------------------------------- 3 errors


def check_points_that_are_not_finite_never_come_out(case):
    """Refuse a point that is not finite, unless the port is not read for what was asked."""
    for port in range(len(case.ports)):
        inputs = case.inputs()
        inputs[port] = poisoned(inputs[port])
        try:
            output = case.filter(*inputs).update().output
        except ValueError:
            raises_each_time_and_is_mended(case, port, poisoned)
        else:
            for leaf in leaves(output):
                assert np.isfinite(points_of(leaf)).all(), "points that are not finite came out"


def check_empty_inputs_are_refused(case):
    for number, port in enumerate(case.ports):
        if not port.may_be_empty:
            raises_each_time_and_is_mended(case, number, lambda data: data.NewInstance())


def check_an_open_port_is_named(case):
    required = [port.name for port in case.ports if not port.optional]
    for name in required[:1]:
        told = f"{case.kind.__name__}: {name}: it is not connected; it must be a vtk"
        with pytest.raises(ValueError, match=told):
            case.filter().update()


def check_runs_without_optional_inputs(case):
    """Run, or name an optional port; then run with one after the other as a new filter does."""
    filter_ = case.filter(*(None if p.optional else example(case.kind, p) for p in case.ports))

    def outcome(algorithm):
        try:
            return digests(algorithm)
        except ValueError as error:
            return str(error)

    optional, without = [port for port in case.ports if port.optional], outcome(filter_)
    refused = isinstance(without, str) and not any(port.name in without for port in optional)
    assert not refused, f"an open port is not named: {without}"
    for port in optional:
        filter_.connect(port.name, example(case.kind, port))
        assert outcome(filter_) == outcome(copy(filter_)), f"that {port.name} was open still counts"


def raises_each_time_and_is_mended(case, port, make_bad):
    good = case.inputs()
    bad = [make_bad(data) if number == port else data for number, data in enumerate(good)]
    algorithm = case.filter(*bad)
    messages = set()
    for _ in range(3):
        with pytest.raises(ValueError, match=r"\w") as caught:
            algorithm.update()
        messages.add(str(caught.value))
    assert len(messages) == 1, f"the error changes from one try to the next: {messages}"
    with pytest.raises(ValueError, match=r"\w"):
        case.filter().apply(*bad)
    with quiet_vtk():
        for _ in range(2):
            assert not algorithm.Update(), "Update() says that all is well"
            assert is_empty(algorithm.GetOutputDataObject(0)), "a failed filter left something in its output"
    downstream = PassOn()
    downstream.connect(0, algorithm)
    for _ in range(2):
        with pytest.raises(ValueError, match=r"\w") as caught:
            downstream.update()
        assert str(caught.value) in messages, "a filter downstream does not surface the cause"
    algorithm.connect(port, good[port])
    assert digests(algorithm) == case.reference(), "the filter does not recover when its input is mended"


@contextmanager
def quiet_vtk():
    """Keep VTK's message about a failed request out of the log."""
    displayed = vtkObject.GetGlobalWarningDisplay()
    vtkObject.GlobalWarningDisplayOff()
    try:
        yield
    finally:
        vtkObject.SetGlobalWarningDisplay(displayed)


# -------------------------------------------------------------------- 4 executions


def check_executes_only_on_change(case):
    inputs = case.inputs()
    algorithm = case.filter(*inputs)
    calls = count_executions(algorithm)
    algorithm.update()
    algorithm.update()
    algorithm.Update()
    assert len(calls) == 1, "executed again although nothing changed"
    changes = [
        (port, each) for port, of in zip(case.ports, inputs, strict=True) for each in (of, *leaves(of))
    ]
    for port, data in changes:
        data.Modified()
        before = len(calls)
        algorithm.update()
        algorithm.update()
        assert len(calls) == before + 1, f"a change of {port.name}: {len(calls) - before} executions, not 1"
    for name, declaration in case.declarations.items():
        if declaration.kind in OBJECTS or len(declaration.choices) == 1:
            continue
        before, value = len(calls), getattr(algorithm, name)
        setattr(algorithm, name, other_value(declaration, value))
        execute_or_refuse(algorithm)
        assert len(calls) > before, f"a change of {name} did not lead to an execution"
        setattr(algorithm, name, value)
        algorithm.update()


def execute_or_refuse(algorithm):
    """Bring up to date; a value may be allowed by itself and yet not fit the data."""
    try:
        algorithm.update()
    except ValueError:
        return


def check_executes_for_each_time(case):
    """Also where the first input has no times."""
    for still in range(min(len(case.ports), 2)):
        algorithm = case.timed(still)
        calls = count_executions(algorithm)
        seen = {}
        for time in (*TIMES, TIMES[0]):
            before = len(calls)
            hashed = digests(algorithm, time=time)
            assert len(calls) == before + 1, f"time {time:g}: {len(calls) - before} executions, not 1"
            assert digests(algorithm, time=time) == hashed
            assert len(calls) == before + 1, f"time {time:g}: executed again although nothing changed"
            assert seen.setdefault(time, hashed) == hashed, f"time {time:g} gives another result, asked again"
        fresh, again = (filter_.update(time=TIMES[-1]).output for filter_ in (case.timed(still), algorithm))
        if case.kind.__name__ == "TautPaths":  # its start counts within the solver's tolerance
            np.testing.assert_allclose(points_of(fresh), points_of(again), rtol=0.0, atol=1e-3)
        else:
            assert results_digests(fresh) == seen[TIMES[-1]], "the result depends on what was asked before"


# -------------------------------------------------------------------- 5 progress and abort


def check_progress_goes_from_0_to_1(case):
    algorithm, seen = case.filter(*case.inputs()), []
    algorithm.AddObserver("ProgressEvent", lambda caller, _: seen.append(caller.GetProgress()))
    algorithm.update()
    assert seen, "no progress was reported"
    assert seen == sorted(seen), f"progress goes back: {seen}"
    assert seen[0] == 0.0, f"progress does not start at 0: {seen}"
    assert seen[-1] == 1.0, f"progress does not end at 1: {seen}"


def check_abort_leaves_no_output(case):
    """Abort at the first progress event, and at the first one on the way."""
    for after in (0.0, 1e-9):
        algorithm, reached = case.filter(*case.inputs()), []

        def abort(caller, _, after=after, reached=reached):
            if not reached and after <= caller.GetProgress() < 1.0:
                reached.append(caller.GetProgress())
                caller.SetAbortExecute(1)

        observer = algorithm.AddObserver("ProgressEvent", abort)
        try:
            algorithm.update()
        except AbortedError:
            assert is_empty(algorithm.GetOutputDataObject(0)), (
                "an aborted filter left something in its output"
            )
        else:
            assert not reached, "a filter was not aborted"
            assert after, "there is no progress event at the start"
        algorithm.RemoveObserver(observer)
        assert digests(algorithm) == case.reference(), "an aborted filter does not recover"


# -------------------------------------------------------------------- 6 ways of running


def check_all_ways_of_running_agree(case):
    import pyvista as pv

    inputs, expected = case.inputs(), case.reference()
    by_connection, producers = case.filter(), []
    for port, data in enumerate(inputs):
        producers.append(vtkTrivialProducer())
        producers[port].SetOutput(data)
        by_connection.SetInputConnection(port, producers[port].GetOutputPort())
    found = {"SetInputConnection": digests(by_connection), "once more": digests(case.filter(*case.inputs()))}
    found["filter(data)"] = results_digests(case.filter()(*inputs))
    applied = case.filter().apply(*inputs)
    assert isinstance(applied, pv.DataObject), f"apply() gives a {type(applied).__name__}, not PyVista's"
    found["apply(data)"] = results_digests(applied)
    if inputs:
        wrapped = [pv.wrap(data) for data in inputs]
        found["filter(PyVista data)"] = results_digests(case.filter()(*wrapped))
        for name, first in (("data >> filter", inputs[0]), ("source >> filter", producers[0])):
            algorithm = case.filter(None, *inputs[1:])
            chain = first >> algorithm
            found[name] = results_digests(chain.update().output)
        if inputs[0].IsA("vtkPolyData"):
            chain = PassOn() >> case.filter(None, *inputs[1:])
            found["filter >> filter"] = results_digests(chain(inputs[0]))
    for name, hashed in found.items():
        assert hashed == expected, f"{name} gives another result"


def check_pyvista_shows_it(case):
    import pyvista as pv

    if (reason := can_render()) is not None:
        pytest.skip(reason)
    algorithm = case.filter(*case.inputs())
    expected = case.reference()
    plotter = pv.Plotter(off_screen=True, window_size=(64, 64))
    try:
        if algorithm.GetOutputDataObject(0).IsA("vtkMultiBlockDataSet"):
            # PyVista's add_mesh refuses algorithms that give several blocks: merge them on the way.
            merger = vtkCompositeDataGeometryFilter()
            merger.SetInputConnection(algorithm.GetOutputPort())
            plotter.add_mesh(merger)
            plotter.render()
            merged = vtkCompositeDataGeometryFilter()
            merged.SetInputDataObject(algorithm.update().output)
            merged.Update()
            expected = [digest(merged.GetOutput())]
        else:
            plotter.add_mesh(algorithm)
            plotter.render()
        shown = plotter.mapper.GetInputDataObject(0, 0)
        assert [digest(shown)] == expected, "PyVista shows another result"
        assert digests(algorithm) == case.reference(), "being shown changes the result"
    finally:
        plotter.close()


# -------------------------------------------------------------------- 9 memory


def check_freed_without_the_garbage_collector(case):
    gc.collect()
    gc.disable()
    try:
        algorithm = case.filter(*case.inputs())
        algorithm.update()
        alive, alive_in_vtk = weakref.ref(algorithm), vtkWeakReference()
        alive_in_vtk.Set(algorithm)
        del algorithm
        assert alive() is None, "the filter is kept alive by a reference cycle"
        assert alive_in_vtk.Get() is None, "VTK's side of the filter is kept alive"
    finally:
        gc.enable()


def check_disconnected_inputs_are_freed(case):
    if not case.ports:
        return
    gc.collect()
    gc.disable()
    try:
        inputs = case.inputs()
        algorithm = case.filter(*inputs)
        algorithm.update()
        references = []
        for port, data in zip(case.ports, inputs, strict=True):
            reference = vtkWeakReference()
            reference.Set(data)
            references.append((port.name, reference))
        for number in range(len(inputs)):
            algorithm.SetInputConnection(number, None)
        del inputs, data
        kept = [name for name, reference in references if reference.Get() is not None]
        assert not kept, f"after they were disconnected these inputs are kept alive: {', '.join(kept)}"
    finally:
        gc.enable()


#: All checks, each a function of a case.
CHECKS = [
    check for name, check in {**vars(contract_declarations), **globals()}.items() if name.startswith("check_")
]
