"""A filter's description for ParaView's server manager, from what the filter declares."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement, tostring

from vtkmuscle.filters.base.docstrings import split_docstring
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.ports import InputPort
from vtkmuscle.paraview.properties import FILES, camel_case, plain, properties_of, spaced

#: The menu in which all filters are found.
CATEGORY = "Muscle"


def proxy_parts(kind: type[Filter]) -> list[str]:
    """Return what stands inside a filter's proxy: documentation, inputs, properties and outputs.

    Parameters
    ----------
    kind : type
        A filter class.

    Returns
    -------
    list of str
        XML elements, in the order in which ParaView shows them.
    """
    parts = [_documentation(kind)]
    parts += [_input(number, port) for number, port in enumerate(kind.input_ports)]
    declared = kind.parameter_declarations.values()
    parts += [shown.xml for parameter in declared for shown in properties_of(parameter, declared)]
    if kind.times_from is not None or kind.time_steps is not Filter.time_steps:
        parts.append(_times())
    if len(kind.output_ports) > 1:
        parts += [
            Element("OutputPort", index=str(number), name=camel_case(port.name), id=f"port{number}")
            for number, port in enumerate(kind.output_ports)
        ]
    return [tostring(part, encoding="unicode") for part in parts]


def proxy_hints(kind: type[Filter]) -> list[str]:
    """Return XML hints of a filter's proxy: its menu; and of a source that reads a file, that it does."""
    hints = [Element("ShowInMenu", category=CATEGORY)]
    if not kind.input_ports:
        files = [FILES[p.kind] for p in kind.parameter_declarations.values() if p.kind in FILES]
        hints += [
            Element(
                "ReaderFactory", extensions=file.extensions, file_description=f"Muscle: {file.description}"
            )
            for file in files
        ]
    return [tostring(hint, encoding="unicode") for hint in hints]


def _documentation(kind: type[Filter]) -> Element:
    summary, _, rest = plain(split_docstring(kind.__doc__ or "")[0]).partition("\n\n")
    text = "\n\n".join(" ".join(paragraph.split()) for paragraph in rest.split("\n\n"))
    element = Element("Documentation", short_help=summary, long_help=summary)
    element.text = f"{summary}\n\n{text}".strip()
    return element


def _input(number: int, port: InputPort) -> Element:
    name = camel_case(port.name)
    element = Element(
        "InputProperty", name=name, label=spaced(name), command="SetInputConnection", port_index=str(number)
    )
    groups = SubElement(element, "ProxyGroupDomain", name="groups")
    SubElement(groups, "Group", name="sources")
    SubElement(groups, "Group", name="filters")
    types = SubElement(element, "DataTypeDomain", name="input_type")
    SubElement(types, "DataType", value=port.type_name)
    SubElement(element, "Documentation").text = plain(port.doc)
    if port.optional:
        SubElement(SubElement(element, "Hints"), "Optional")
    return element


def _times() -> Element:
    """Return the property by which ParaView's animation learns the time steps."""
    element = Element("DoubleVectorProperty", name="TimestepValues", repeatable="1", information_only="1")
    SubElement(element, "TimeStepsInformationHelper")
    return element
