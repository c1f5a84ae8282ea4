"""What every filter must do with its declarations: parameters, rebuilding, documentation.

DESIGN's contract, points 1, 7 and 10; see :mod:`contract`.
"""

import copy
import inspect
import math
import pickle

import pytest
from filter_case import digests, other_value

from examples import OBJECTS

# -------------------------------------------------------------------- 1 parameters


def check_unknown_keyword_is_refused(case):
    with pytest.raises(TypeError, match="no_such_parameter"):
        case.kind(no_such_parameter=1)


def check_bad_values_are_refused(case):
    algorithm = case.filter()
    for name, declaration in case.declarations.items():
        before = getattr(algorithm, name)
        for value in bad_values(declaration):
            try:
                setattr(algorithm, name, value)
            except ValueError as error:
                message = str(error)
            else:
                raise AssertionError(f"{name} = {value!r} was accepted")
            for part in (name, repr(value), declaration.allowed):
                assert part in message, f"{name} = {value!r}: the error does not say {part!r}: {message}"
            assert getattr(algorithm, name) is before


def check_setting_the_same_value_modifies_nothing(case):
    algorithm = case.filter()
    for name, declaration in case.declarations.items():
        before = algorithm.GetMTime()
        setattr(algorithm, name, getattr(algorithm, name))
        assert algorithm.GetMTime() == before, f"{name}: modified by the value it has"
        other = other_value(declaration, getattr(algorithm, name))
        setattr(algorithm, name, other)
        if len(declaration.choices) != 1:
            assert algorithm.GetMTime() > before, f"{name}: not modified by another value"


def bad_values(declaration):
    """Return values that a parameter must refuse."""
    number = [math.nan, math.inf, "many", True, [1.0]]
    bad = {
        int: [*number, 1.5],
        float: number,
        bool: ["yes", 1],
        str: [3, b"text"],
        tuple: ["abc", 1.0, tuple([math.nan] * (declaration.length or 1)), (0.0,) * 7],
    }.get(declaration.kind, [object(), "an object"])
    if declaration.choices:
        bad.append("no such choice")
    if declaration.minimum is not None:
        bad.append(declaration.kind(declaration.minimum - 1))
    if declaration.above is not None:
        bad.append(declaration.kind(declaration.above))
    if declaration.maximum is not None:
        bad.append(declaration.kind(declaration.maximum + 1))
    return bad if declaration.default is None else [*bad, None]


# -------------------------------------------------------------------- 7 rebuilding


def check_rebuilt_from_its_parameters(case):
    algorithm = case.filter(*case.inputs())
    for name, declaration in case.declarations.items():
        if declaration.kind not in OBJECTS:
            setattr(algorithm, name, other_value(declaration, getattr(algorithm, name)))
    for twin in (case.kind(**algorithm.parameters()), pickle.loads(pickle.dumps(algorithm))):
        assert type(twin) is case.kind
        for name, declaration in case.declarations.items():
            if declaration.kind not in OBJECTS:
                assert getattr(twin, name) == getattr(algorithm, name), f"{name} is lost"
    again = pickle.loads(pickle.dumps(case.filter()))
    for port, data in enumerate(case.inputs()):
        again.connect(port, data)
    assert digests(again) == case.reference(), "the unpickled filter gives another result"
    for copied in (copy.copy, copy.deepcopy):
        assert digests(copied(again)) == case.reference(), "a copy gives another result"


# -------------------------------------------------------------------- 10 documentation


def check_documented(case):
    text = inspect.cleandoc(case.kind.__doc__)
    summary = text.split("\n\n")[0]
    assert summary.endswith("."), f"the summary is no sentence: {summary!r}"
    for name, declaration in case.declarations.items():
        line = f"{name} : {declaration.allowed}, default: {declaration.default!r}"
        assert line in text, f"{name} is not documented"
        assert declaration.doc.rstrip().endswith("."), f"the sentence on {name} has no end"
    for number, port in enumerate(case.ports):
        optional = ", optional" if port.optional else ""
        line = f"{port.name} : {port.type_name}, input port {number}{optional}"
        assert line in text, f"the port {port.name} is not documented"
        assert port.doc.rstrip().endswith("."), f"the sentence on port {port.name} has no end"
    for number, port in enumerate(case.kind.output_ports):
        assert f"Output port {number}, ``{port.name}``" in text
    sections = [
        line
        for line, rule in zip(text.splitlines(), text.splitlines()[1:], strict=False)
        if _ruled(line, rule)
    ]
    if case.ports:
        assert "Raises" in sections, "there is no section Raises"
    assert sections[-2:] == ["Limitations", "Examples"], "the last sections are not Limitations, Examples"
    if "References" in sections:
        assert "doi:10." in text.split("References\n")[1], "the references have no DOI"


def _ruled(line, rule):
    return bool(line) and len(rule) == len(line) and set(rule) == {"-"}
