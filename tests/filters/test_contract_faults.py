"""Planted faults: small filters that break the contract, each in one way, and must be caught by its check."""

import contract
import contract_declarations
import numpy as np
import pytest
from filter_case import Case, poisoned
from vtkmodules.vtkCommonDataModel import vtkPolyData

from examples import example
from vtkmuscle.data.arrays import add_arrays, points_of, polylines_from, polylines_of, with_points
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.base.ports import InputPort, OutputPort

REFUSED = AssertionError, pytest.fail.Exception


class Sound(Filter):
    """A filter as it should be, for the faulty ones to differ from.

    Raises
    ------
    ValueError
        If there are no fibres.

    Limitations
    -----------
    Scales about the origin only.

    Examples
    --------
    >>> 1 + 1
    2
    """

    scale = Parameter(float, default=1.0, minimum=0.0, doc="Factor.")
    fibres = InputPort(vtkPolyData, doc="Polylines.")
    output = OutputPort(vtkPolyData, doc="The polylines, scaled.")

    def execute(self, fibres):
        return with_points(fibres, self.scale * polylines_of(fibres, "Sound: fibres").points)


class PicklesBadly(Sound):
    """Forgets its parameters when it is pickled."""

    def __reduce__(self):
        return type(self), ()


def faulty(name, **members):
    return type(name, (Sound,), {"__doc__": "Breaks the contract.", **members})


def executing(name, execute):
    """Return a filter with another ``execute``, which takes the filter and its input."""
    return faulty(name, execute=execute)


def changes_its_input(self, fibres):
    fibres.GetPoints().SetPoint(0, 1.0, 2.0, 3.0)
    return Sound.execute(self, fibres)


def adds_to_its_input(self, fibres):
    add_arrays(fibres, fields={"Leftover": 1.0})
    return Sound.execute(self, fibres)


def keeps_its_input(self, fibres):
    self._last = fibres
    return Sound.execute(self, fibres)


def leaks_by_a_cycle(self, **parameters):
    Sound.__init__(self, **parameters)
    self._myself = self


def leaks_by_an_observer(self, **parameters):
    Sound.__init__(self, **parameters)
    self.AddObserver("EndEvent", self.has_ended)


def re_executes(self, time=None):
    self.Modified()
    return Sound.update(self, time)


def goes_back(self, fibres):
    self.UpdateProgress(0.9)
    self.UpdateProgress(0.3)
    return Sound.execute(self, fibres)


def has_history(self, fibres):
    self._count = getattr(self, "_count", 0) + 1
    return with_points(fibres, points_of(fibres) + self._count)


def is_single_precision(self, fibres):
    result = fibres.NewInstance()
    result.DeepCopy(fibres)
    result.GetPoints().SetDataTypeToFloat()
    return result


def swallows_errors(self, fibres):
    return Sound.execute(self, fibres) if np.isfinite(points_of(fibres)).all() else vtkPolyData()


def takes_any_value():
    anything = Parameter(float, default=1.0, doc="Factor.")
    anything.check = lambda value, owner: value
    return faulty("TakesAnyValue", scale=anything)


def raises_on_nan(case):
    contract.raises_each_time_and_is_mended(case, 0, poisoned)


IGNORES_ITS_PARAMETER = faulty("IgnoresItsParameter", Modified=lambda self: None)
IS_RANDOM = executing(
    "IsRandom", lambda self, fibres: with_points(fibres, points_of(fibres) + np.random.default_rng().normal())
)
LETS_NAN_THROUGH = executing("LetsNaNThrough", lambda self, fibres: with_points(fibres, points_of(fibres)))
FAULTS = [
    (executing("ChangesItsInput", changes_its_input), contract.check_inputs_are_unchanged),
    (executing("AddsToItsInput", adds_to_its_input), contract.check_inputs_are_unchanged),
    (faulty("Cycle", __init__=leaks_by_a_cycle), contract.check_freed_without_the_garbage_collector),
    (
        faulty("Observer", __init__=leaks_by_an_observer, has_ended=lambda self, caller, event: None),
        contract.check_freed_without_the_garbage_collector,
    ),
    (executing("KeepsItsInput", keeps_its_input), contract.check_disconnected_inputs_are_freed),
    (faulty("ReExecutes", update=re_executes), contract.check_executes_only_on_change),
    (IGNORES_ITS_PARAMETER, contract_declarations.check_setting_the_same_value_modifies_nothing),
    (IGNORES_ITS_PARAMETER, contract.check_executes_only_on_change),
    (
        faulty("Forgets", _provenance_array=lambda self, inputs: Sound._provenance_array(self, [])),
        contract.check_provenance_travels,
    ),
    (
        executing("DropsArrays", lambda self, fibres: polylines_from(polylines_of(fibres, "fibres"))),
        contract.check_other_arrays_pass_through,
    ),
    (IS_RANDOM, contract.check_same_result_each_time),
    (IS_RANDOM, contract.check_all_ways_of_running_agree),
    (executing("GoesBack", goes_back), contract.check_progress_goes_from_0_to_1),
    (executing("HasHistory", has_history), contract.check_executes_for_each_time),
    (executing("IsSinglePrecision", is_single_precision), contract.check_outputs_are_finite_doubles),
    (takes_any_value(), contract_declarations.check_bad_values_are_refused),
    (PicklesBadly, contract_declarations.check_rebuilt_from_its_parameters),
    (LETS_NAN_THROUGH, contract.check_points_that_are_not_finite_never_come_out),
    (LETS_NAN_THROUGH, raises_on_nan),
    (executing("SwallowsErrors", swallows_errors), raises_on_nan),
    (
        faulty("IgnoresAbort", report_progress=lambda self, fraction: self.UpdateProgress(fraction)),
        contract.check_abort_leaves_no_output,
    ),
    (
        faulty("TakesAnything", __init__=lambda self, **_: Sound.__init__(self)),
        contract_declarations.check_unknown_keyword_is_refused,
    ),
    (
        faulty("FailingExample", __doc__="Does.\n\nExamples\n--------\n>>> 1 + 1\n3\n"),
        contract_declarations.check_examples_run,
    ),
    (faulty("SaysNothingOfErrors"), contract_declarations.check_documented),
]


@pytest.mark.parametrize(("fault", "check"), FAULTS, ids=lambda value: value.__name__)
def test_planted_fault_is_caught(fault, check):
    check(Case(Sound))
    with pytest.raises(REFUSED):
        check(Case(fault))


def test_port_without_an_example_is_named():
    with pytest.raises(AssertionError, match="'output': add an example"):
        example(Sound, Sound.output_ports[0])
