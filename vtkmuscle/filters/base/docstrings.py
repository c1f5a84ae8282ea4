"""Docstrings of filters, with kinds and bounds from the declarations."""

import inspect
import re
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Any

#: Sections of a class's docstring with the entries of parameters and ports.
_DECLARED = re.compile(r"^(?:Parameters|Attributes)\n-+\n(?:\S.*\n(?: {4}.*\n)+)+\n*", re.MULTILINE)


def entry(doc: str | None, name: str) -> str:
    r"""Return a name's entry in a docstring, "" without an entry.

    Examples
    --------
    >>> from vtkmuscle.filters.base.docstrings import entry
    >>> entry("Parameters\n----------\nsides : int\n    Number of sides\n    of a tube.\n", "sides")
    'Number of sides of a tube.'
    """
    match = re.search(rf"^( *){name}(?: : .*)?\n((?:\1 {{4}}.*\n)+)", doc or "", re.MULTILINE)
    return " ".join(match[2].split()) if match else ""


@dataclass(eq=False)
class Declaration:
    """A class attribute of a filter: kind, name, description from the docstring."""

    kind: type[Any]
    _: KW_ONLY
    doc: str = ""
    name: str = field(default="", init=False)

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name
        self.doc = self.doc or entry(owner.__doc__, name)


def documented(doc: str, parameters: Mapping[str, Any], inputs: Sequence[Any], outputs: Sequence[Any]) -> str:
    """Return the docstring with kinds and bounds of parameters and ports."""
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
    return "\n".join([*lines, _DECLARED.sub("", f"{sections}\n").rstrip()])


def described(parameter: Any) -> str:
    """Return a parameter's description, unit and condition."""
    units = f" [{parameter.units}]" if parameter.units else ""
    return f"{parameter.doc}{units}{parameter.condition}"


def split_docstring(doc: str) -> tuple[str, str]:
    """Split a cleaned docstring before its first section heading."""
    section = re.search(r"^\S.*\n-+$", doc, re.MULTILINE)
    return (doc[: section.start()].rstrip(), doc[section.start() :]) if section else (doc, "")
