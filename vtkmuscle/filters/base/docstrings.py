"""A filter's docstring, completed from its declarations."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from typing import Any

from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.base.ports import InputPort, OutputPort


def documented(
    doc: str,
    parameters: Mapping[str, Parameter[Any]],
    inputs: Sequence[InputPort],
    outputs: Sequence[OutputPort],
) -> str:
    """Return the docstring with parameters and ports written out from the declarations."""
    head, sections = split_docstring(inspect.cleandoc(doc))
    lines = [head]
    if parameters or inputs:
        lines += ["", "Parameters", "----------"]
    for number, port in enumerate(inputs):
        optional = ", optional" if port.optional else ""
        lines += [f"{port.name} : {port.type_name}, input port {number}{optional}", f"    {port.doc}"]
    for name, parameter in parameters.items():
        lines += [f"{name} : {parameter.allowed}, default: {parameter.default!r}"]
        lines += [f"    {described(parameter)}"]
    lines += ["", "Notes", "-----"]
    for number, result in enumerate(outputs):
        lines += [f"Output port {number}, ``{result.name}`` ({result.type_name}): {result.doc}", ""]
    return "\n".join([*lines, sections])


def described(parameter: Parameter[Any]) -> str:
    """Return what a parameter does, its unit, and with what it counts."""
    units = f" [{parameter.units}]" if parameter.units else ""
    return f"{parameter.doc}{units}{parameter.condition}"


def split_docstring(doc: str) -> tuple[str, str]:
    """Return a docstring (cleaned of its indent) up to its first section heading, and the rest of it."""
    lines = doc.splitlines()
    for i in range(1, len(lines)):
        if lines[i] and set(lines[i]) == {"-"} and len(lines[i]) == len(lines[i - 1]):
            return "\n".join(lines[: i - 1]).rstrip(), "\n".join(lines[i - 1 :])
    return doc, ""
