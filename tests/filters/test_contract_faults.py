"""Planted faults: small filters that break the contract, each in one way, and must be caught by its check."""

import contract
import contract_declarations
import numpy as np
import pytest
from filter_case import Case, poisoned
from vtkmodules.vtkCommonDataModel import vtkPolyData

from examples import example
from vtkmuscle.data.arrays import points_of, polylines_from, polylines_of, set_field_array, with_points
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.base.ports import InputPort, OutputPort


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


class ChangesItsInput(Sound):
    """Writes into the data that it was given."""

    def execute(self, fibres):
        fibres.GetPoints().SetPoint(0, 1.0, 2.0, 3.0)
        return super().execute(fibres)


class AddsToItsInput(Sound):
    """Leaves an array in the data that it was given."""

    def execute(self, fibres):
        set_field_array(fibres, "Leftover", 1.0)
        return super().execute(fibres)


class LeaksByACycle(Sound):
    """Refers to itself."""

    def __init__(self, **parameters):
        super().__init__(**parameters)
        self._myself = self


class LeaksByAnObserver(Sound):
    """Observes itself by a bound method."""

    def __init__(self, **parameters):
        super().__init__(**parameters)
        self.AddObserver("EndEvent", self.ended)

    def ended(self, caller, event):
        pass


class KeepsItsInput(Sound):
    """Remembers the data that it was given."""

    def execute(self, fibres):
        self._last = fibres
        return super().execute(fibres)


class ReExecutes(Sound):
    """Is modified by being brought up to date."""

    def update(self, time=None):
        self.Modified()
        return super().update(time)


class IgnoresItsParameter(Sound):
    """Sets a parameter without telling VTK."""

    def Modified(self):
        pass


class DropsArrays(Sound):
    """Gives back the lines alone."""

    def execute(self, fibres):
        return polylines_from(polylines_of(fibres, "DropsArrays: fibres"))


class ForgetsWhereItComesFrom(Sound):
    """Says only that it ran."""

    def _provenance_array(self, inputs):
        return super()._provenance_array([])


class SwallowsErrors(Sound):
    """Gives an empty output where it fails."""

    def execute(self, fibres):
        if not np.isfinite(points_of(fibres)).all():
            return vtkPolyData()
        return super().execute(fibres)


class LetsNaNThrough(Sound):
    """Does not look at what it is given."""

    def execute(self, fibres):
        return with_points(fibres, points_of(fibres))


class IsRandom(Sound):
    """Gives another result each time."""

    def execute(self, fibres):
        return with_points(fibres, points_of(fibres) + np.random.default_rng().normal())


class GoesBack(Sound):
    """Reports progress that goes back."""

    def execute(self, fibres):
        self.UpdateProgress(0.9)
        self.UpdateProgress(0.3)
        return super().execute(fibres)


class IgnoresAbort(Sound):
    """Goes on when it is asked to stop."""

    def report_progress(self, fraction):
        self.UpdateProgress(fraction)


class HasHistory(Sound):
    """Gives a result that depends on what was asked before."""

    count = 0

    def execute(self, fibres):
        self.count += 1
        return with_points(fibres, points_of(fibres) + self.count)


class IsSinglePrecision(Sound):
    """Rounds its output to single precision."""

    def execute(self, fibres):
        result = fibres.NewInstance()
        result.DeepCopy(fibres)
        result.GetPoints().SetDataTypeToFloat()
        return result


class TakesAnything(Sound):
    """Swallows keywords that are no parameters."""

    def __init__(self, **parameters):
        super().__init__(**{name: value for name, value in parameters.items() if name == "scale"})


class TakesAnyValue(Sound):
    """Does not check its parameter."""

    scale = Parameter(float, default=1.0, doc="Factor.")
    scale.check = lambda value, owner: value


class PicklesBadly(Sound):
    """Forgets its parameters when it is pickled."""

    def __reduce__(self):
        return type(self), ()


FAULTS = [
    (ChangesItsInput, contract.check_inputs_are_unchanged),
    (AddsToItsInput, contract.check_inputs_are_unchanged),
    (LeaksByACycle, contract.check_freed_without_the_garbage_collector),
    (LeaksByAnObserver, contract.check_freed_without_the_garbage_collector),
    (KeepsItsInput, contract.check_disconnected_inputs_are_freed),
    (ReExecutes, contract.check_executes_only_on_change),
    (IgnoresItsParameter, contract_declarations.check_setting_the_same_value_modifies_nothing),
    (IgnoresItsParameter, contract.check_executes_only_on_change),
    (ForgetsWhereItComesFrom, contract.check_provenance_travels),
    (DropsArrays, contract.check_other_arrays_pass_through),
    (IsRandom, contract.check_same_result_each_time),
    (IsRandom, contract.check_all_ways_of_running_agree),
    (GoesBack, contract.check_progress_goes_from_0_to_1),
    (HasHistory, contract.check_executes_for_each_time),
    (IsSinglePrecision, contract.check_outputs_are_finite_doubles),
    (TakesAnyValue, contract_declarations.check_bad_values_are_refused),
    (PicklesBadly, contract_declarations.check_rebuilt_from_its_parameters),
]


@pytest.mark.parametrize(("fault", "check"), FAULTS, ids=lambda value: value.__name__)
def test_planted_fault_is_caught(fault, check):
    check(Case(Sound))
    with pytest.raises(AssertionError):
        check(Case(fault))


@pytest.mark.parametrize("fault", [SwallowsErrors, LetsNaNThrough])
def test_planted_silence_about_bad_input_is_caught(fault):
    with pytest.raises((AssertionError, pytest.fail.Exception)):
        contract.check_bad_inputs_raise_each_time_and_are_mended(Case(fault), 0, poisoned)


def test_planted_nan_is_caught():
    with pytest.raises(AssertionError):
        contract.check_points_that_are_not_finite_never_come_out(Case(LetsNaNThrough), 0)


def test_planted_deafness_to_abort_is_caught():
    with pytest.raises((AssertionError, pytest.fail.Exception)):
        contract.check_abort_leaves_no_output(Case(IgnoresAbort), after=0.0)


def test_planted_swallowed_keyword_is_caught():
    with pytest.raises((AssertionError, pytest.fail.Exception)):
        contract_declarations.check_unknown_keyword_is_refused(Case(TakesAnything))


def test_planted_failing_example_is_caught():
    class HasAFailingExample(Sound):
        """Does.

        Examples
        --------
        >>> 1 + 1
        3
        """

    with pytest.raises(AssertionError, match="Got"):
        contract_declarations.check_examples_run(Case(HasAFailingExample))


def test_planted_missing_section_is_caught():
    class SaysNothingOfErrors(Sound):
        """Does."""

    with pytest.raises(AssertionError, match="Raises"):
        contract_declarations.check_documented(Case(SaysNothingOfErrors))


def test_port_without_an_example_is_named():
    with pytest.raises(AssertionError, match="'output': add an example"):
        example(Sound, Sound.output_ports[0])
