"""DESIGN's contract, over all filters that there are: a new filter is under test the moment it exists."""

import re
from pathlib import Path

import contract
import contract_declarations
import pytest
from filter_case import Case

import vtkmuscle.filters
from examples import example
from vtkmuscle.plotting import can_render

FILTERS = vtkmuscle.filters.filter_classes()
WITH_INPUTS = [kind for kind in FILTERS if kind.input_ports]
PORTS = [
    pytest.param(kind, number, id=f"{kind.__name__}-{port.name}")
    for kind in WITH_INPUTS
    for number, port in enumerate(kind.input_ports)
]

every_filter = pytest.mark.parametrize("kind", FILTERS, ids=lambda kind: kind.__name__)
every_filter_with_inputs = pytest.mark.parametrize("kind", WITH_INPUTS, ids=lambda kind: kind.__name__)
every_port = pytest.mark.parametrize(("kind", "port"), PORTS)


def test_filters_are_found():
    assert {"FibreSmoother", "BoneMotion"} <= {kind.__name__ for kind in FILTERS}


def test_every_filter_in_the_package_is_public():
    written = {
        name
        for file in Path(vtkmuscle.filters.__path__[0]).rglob("*.py")
        for name in re.findall(
            r"^class (\w+)\(.*\b(?:Filter|HistoryFilter\[\w+\])\)",
            file.read_text(encoding="utf-8"),
            re.MULTILINE,
        )
    }
    assert written == {kind.__name__ for kind in FILTERS}
    assert written < set(vtkmuscle.filters.__all__)


@every_port
def test_port_has_an_example(kind, port):
    data = example(kind, kind.input_ports[port])
    assert data.IsA(kind.input_ports[port].type_name)


@every_filter
def test_unknown_keyword_is_refused(kind):
    contract_declarations.check_unknown_keyword_is_refused(Case(kind))


@every_filter
def test_bad_values_are_refused(kind):
    contract_declarations.check_bad_values_are_refused(Case(kind))


@every_filter
def test_setting_the_same_value_modifies_nothing(kind):
    contract_declarations.check_setting_the_same_value_modifies_nothing(Case(kind))


@every_filter_with_inputs
def test_inputs_are_unchanged(kind):
    contract.check_inputs_are_unchanged(Case(kind))


@every_filter_with_inputs
def test_other_arrays_pass_through(kind):
    contract.check_other_arrays_pass_through(Case(kind))


@every_filter
def test_provenance_travels(kind):
    contract.check_provenance_travels(Case(kind))


@every_filter
def test_outputs_are_finite_doubles(kind):
    contract.check_outputs_are_finite_doubles(Case(kind))


@every_filter_with_inputs
def test_runs_without_optional_inputs(kind):
    case = Case(kind)
    inputs = [None if port.optional else example(kind, port) for port in kind.input_ports]
    try:
        case.filter(*inputs).update()
        message = ""
    except ValueError as error:
        message = str(error)
    named = [port.name for port in kind.input_ports if port.optional]
    assert not message or any(name in message for name in named), f"an open port is not named: {message}"


@every_port
def test_points_that_are_not_finite_never_come_out(kind, port):
    contract.check_points_that_are_not_finite_never_come_out(Case(kind), port)


@every_port
def test_empty_inputs_are_refused(kind, port):
    if Case(kind).ports[port].may_be_empty:
        pytest.skip("takes data without points")
    empty = lambda data: data.NewInstance()  # noqa: E731
    contract.check_bad_inputs_raise_each_time_and_are_mended(Case(kind), port, empty)


@every_filter
def test_executes_only_on_change(kind):
    contract.check_executes_only_on_change(Case(kind))


@every_filter_with_inputs
def test_executes_for_each_time(kind):
    contract.check_executes_for_each_time(Case(kind))


@every_filter
def test_progress_goes_from_0_to_1(kind):
    contract.check_progress_goes_from_0_to_1(Case(kind))


@every_filter
@pytest.mark.parametrize("after", [0.0, 1e-9], ids=["at the start", "on the way"])
def test_abort_leaves_no_output(kind, after):
    if not contract.check_abort_leaves_no_output(Case(kind), after=after):
        pytest.skip("reports no progress on the way: nothing to abort between")


@every_filter
def test_all_ways_of_running_agree(kind):
    contract.check_all_ways_of_running_agree(Case(kind))


@every_filter
def test_pyvista_shows_it(kind):
    reason = can_render()
    if reason is not None:
        pytest.skip(reason)
    contract.check_pyvista_shows_it(Case(kind))


@every_filter
def test_rebuilt_from_its_parameters(kind):
    contract_declarations.check_rebuilt_from_its_parameters(Case(kind))


@every_filter
def test_same_result_each_time(kind):
    contract.check_same_result_each_time(Case(kind))


@every_filter
def test_freed_without_the_garbage_collector(kind):
    contract.check_freed_without_the_garbage_collector(Case(kind))


@every_filter_with_inputs
def test_disconnected_inputs_are_freed(kind):
    contract.check_disconnected_inputs_are_freed(Case(kind))


@every_filter
def test_documented(kind):
    contract_declarations.check_documented(Case(kind))


@every_filter
def test_examples_run(kind):
    contract_declarations.check_examples_run(Case(kind))
