"""A filter's docstring, completed from its declarations."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from typing import Any

from vtkmuscle.filters.base.parameters import InputPort, OutputPort, Parameter


def documented(
    doc: str,
    parameters: Mapping[str, Parameter[Any]],
    inputs: Sequence[InputPort],
    outputs: Sequence[OutputPort],
) -> str:
    """Return the docstring with Parameters and ports written out from the declarations."""
    head, sections = split_docstring(inspect.cleandoc(doc))
    lines = [head]
    if parameters:
        lines += ["", "Parameters", "----------"]
        for name, parameter in parameters.items():
            units = f" [{parameter.units}]" if parameter.units else ""
            lines += [f"{name} : {parameter.allowed}, default: {parameter.default!r}"]
            lines += [f"    {parameter.doc}{units}"]
    lines += ["", "Notes", "-----"]
    for number, port in enumerate(inputs):
        optional = ", optional" if port.optional else ""
        lines += [f"Input port {number}, ``{port.name}`` ({port.type_name}{optional}): {port.doc}", ""]
    for number, result in enumerate(outputs):
        lines += [f"Output port {number}, ``{result.name}`` ({result.type_name}): {result.doc}", ""]
    return "\n".join([*lines, sections])


def split_docstring(doc: str) -> tuple[str, str]:
    """Return a docstring (cleaned of its indent) up to its first section heading, and the rest of it."""
    lines = doc.splitlines()
    for i in range(1, len(lines)):
        if lines[i] and set(lines[i]) == {"-"} and len(lines[i]) == len(lines[i - 1]):
            return "\n".join(lines[: i - 1]).rstrip(), "\n".join(lines[i - 1 :])
    return doc, ""
