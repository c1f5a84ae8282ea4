"""Descriptions of filters for ParaView's server manager."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, SubElement, tostring

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.filters.base.docstrings import described, split_docstring
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.base.ports import InputPort
from vtkmuscle.io.motion_table import motion_columns, read_motion_table
from vtkmuscle.scene.reading import read_motion
from vtkmuscle.scenes import Scene

_VECTORS = {bool: "Int", int: "Int", float: "Double", tuple: "Double", str: "String"}
_RANGES = {int: "IntRangeDomain", float: "DoubleRangeDomain"}


class _File(NamedTuple):
    """A file for a value without a property."""

    read: Callable[[Path], Any]
    extensions: str
    description: str


def motion_of_file(path: Path) -> RigidMotion:
    """Read the motion of a scene, or of a CSV table with the columns ``bone``, ``T00`` ... and ``time``."""
    if path.suffix.lower() != ".csv":
        return read_motion(path)
    return read_motion_table(path, time="time" if "time" in motion_columns(path) else None)


#: Kinds of parameters given by a file.
FILES: dict[type, _File] = {
    RigidMotion: _File(motion_of_file, "toml csv", "the motion of a scene.toml, or a table of transforms"),
    Scene: _File(Scene.load, "toml", "a scene.toml"),
}


@dataclass(frozen=True)
class Property:
    """A property of a proxy, such as ``AngleStep``, with XML.

    ``take(state, *values)`` returns the parameter's value for ParaView's values; ``state``, a dict of the
    shell, is shared by a parameter's properties.
    """

    name: str
    xml: Element
    take: Callable[..., Any]

    @property
    def command(self) -> str:
        """Name of the method for ParaView's values."""
        return f"Set{self.name}"


def camel_case(name: str) -> str:
    """Return ``AngleStep`` for ``angle_step``."""
    return "".join(word[:1].upper() + word[1:] for word in name.split("_"))


def spaced(name: str) -> str:
    """Return ``Angle Step`` for ``AngleStep``, and ``PBD Deformer`` for ``PBDDeformer``."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)


def plain(text: str) -> str:
    """Return help text without markup of reStructuredText."""
    return re.sub(r":\w+:`~?([^`]*)`", r"\1", text).replace("``", "")


def properties_of(parameter: Parameter[Any], among: Iterable[Parameter[Any]] = ()) -> list[Property]:
    """Return the properties of a parameter in order: 2 of an optional number, 1 of others."""
    properties = _properties_of(parameter)
    for shown in properties:
        if parameter.listed is not None:
            listed = SubElement(SubElement(shown.xml, "StringListDomain", name="list"), "RequiredProperties")
            SubElement(listed, "Property", name=camel_case(parameter.listed), function="StringInfo")
        if parameter.only_with:
            name, *values = parameter.only_with
            _show_only_with(shown.xml, camel_case(name), values)
        for other in among:
            setting = [choice for choice, group in other.sets.items() if parameter.name in group]
            if setting:
                _show_only_with(shown.xml, camel_case(other.name), setting, inverse="1")
    return properties


def informations_of(kind: type[Filter]) -> dict[str, Element]:
    """Return the read-only properties of a filter, by attribute.

    Read-only are lists of allowed texts, and values set by a preset: ``Iterations`` keeps the user's number,
    ``IterationsInEffect`` is the effective number.
    """
    declared = kind.parameter_declarations
    preset = {name for each in declared.values() for group in each.sets.values() for name in group}
    elements: dict[str, Element] = {}
    for name, parameter in declared.items():
        if name in preset:
            elements[name] = _information(f"{name}_in_effect", _VECTORS[parameter.kind])
        if parameter.listed is not None:
            elements[parameter.listed] = _information(parameter.listed, "String")
    return elements


def _information(attribute: str, kind: str) -> Element:
    name = camel_case(attribute)
    return _named(f"{kind}VectorProperty", name, f"Get{name}", information_only="1")


def _named(tag: str, name: str, command: str, **more: str) -> Element:
    return Element(tag, {"name": name, "label": spaced(name), "command": command} | more)


def _properties_of(parameter: Parameter[Any]) -> list[Property]:
    name = camel_case(parameter.name)
    if parameter.kind in FILES:
        return [_file_property(name, parameter, FILES[parameter.kind])]
    if parameter.kind not in _VECTORS:
        kind = f"a {parameter.kind.__name__}, for which ParaView has no property"
        remedy = "add a kind of file to vtkmuscle.paraview.proxies.FILES"
        raise TypeError(f"parameter {parameter.name!r} is {kind}; {remedy}")
    if parameter.default is None and parameter.kind in _RANGES:
        return _optional_number(name, parameter)
    default = "" if parameter.default is None else parameter.default
    xml = _vector(name, parameter, default, parameter.length or 1)
    return [Property(name, xml, lambda state, *values: _value(parameter, values))]


def _value(parameter: Parameter[Any], values: tuple[Any, ...]) -> Any:
    if parameter.kind is tuple:
        return values
    (value,) = values
    if parameter.kind is bool:
        return bool(value)
    if parameter.kind is str and not value:
        # ParaView gives an empty text as None.
        return None if parameter.default is None else ""
    return value


def _vector(name: str, parameter: Parameter[Any], default: Any, count: int) -> Element:
    xml = _element(name, _VECTORS[parameter.kind], default, count)
    if parameter.kind is bool:
        SubElement(xml, "BooleanDomain", name="bool")
    elif parameter.choices:
        choices = SubElement(xml, "StringListDomain", name="list")
        for choice in ("",) * (parameter.default is None) + parameter.choices:
            SubElement(choices, "String", value=choice)
    elif parameter.kind in _RANGES:
        least = parameter.above if parameter.minimum is None else parameter.minimum
        bounds = {"min": least, "max": parameter.maximum}
        # An integer as 1e+06 would be read as 1.
        written = {end: repr(parameter.kind(bound)) for end, bound in bounds.items() if bound is not None}
        SubElement(xml, _RANGES[parameter.kind], {"name": "range", **written})
    _document(xml, parameter)
    return xml


def _optional_number(name: str, parameter: Parameter[Any]) -> list[Property]:
    """Return a check box for None, and the number without None."""
    box = f"Automatic{name}"
    number = _vector(name, parameter, _first_number(parameter), 1)
    _show_only_with(number, box, ("0",))
    automatic = _element(box, "Int", True, 1)
    SubElement(automatic, "BooleanDomain", name="bool")
    SubElement(automatic, "Documentation").text = f"Leave {spaced(name)} to the filter (None in Python)."

    def take(state: dict[str, Any], value: Any, changed: str) -> Any:
        state[changed] = value
        return None if state.get(box, True) else state.get(name, _first_number(parameter))

    take_box, take_number = partial(take, changed=box), partial(take, changed=name)
    return [Property(box, automatic, take_box), Property(name, number, take_number)]


def _show_only_with(xml: Element, other: str, values: Sequence[str], **more: str) -> None:
    """Show a property only for values of another."""
    hints = xml.find("Hints")
    if hints is None:
        hints = SubElement(xml, "Hints")
    shown = {"mode": "visibility", "property": other, "values": " ".join(values), **more}
    SubElement(hints, "PropertyWidgetDecorator", {"type": "GenericDecorator"} | shown)


def _first_number(parameter: Parameter[Any]) -> Any:
    """Return the initial number, within the parameter's bounds."""
    number = max(1.0, parameter.minimum or 0.0, 2.0 * (parameter.above or 0.0))
    return parameter.kind(number if parameter.maximum is None else min(number, parameter.maximum))


def _file_property(name: str, parameter: Parameter[Any], file: _File) -> Property:
    xml = _element(name, "String", "", 1)
    SubElement(xml, "FileListDomain", name="files")
    _document(xml, parameter, f" Given by {file.description}; empty for none.")
    hints = SubElement(xml, "Hints")
    SubElement(hints, "FileChooser", extensions=file.extensions, file_description=file.description)
    return Property(name, xml, lambda state, path: file.read(Path(path)) if path else None)


def _element(name: str, kind: str, default: Any, count: int) -> Element:
    values = default if isinstance(default, tuple) else (default,)
    texts = [str(int(value)) if isinstance(value, bool) else str(value) for value in values]
    sizes = {"number_of_elements": str(count), "default_values": " ".join(texts)}
    return _named(f"{kind}VectorProperty", name, f"Set{name}", **sizes)


def _document(xml: Element, parameter: Parameter[Any], more: str = "") -> None:
    SubElement(xml, "Documentation").text = f"{plain(described(parameter))}{more}"


#: Menu of all filters.
CATEGORY = "Muscle"


def proxy_parts(kind: type[Filter]) -> list[str]:
    """Return the XML elements of a proxy: documentation, inputs, properties, outputs."""
    parts = [_documentation(kind)]
    parts += [_input(number, port) for number, port in enumerate(kind.input_ports)]
    declared = kind.parameter_declarations.values()
    parts += informations_of(kind).values()
    parts += [shown.xml for parameter in declared for shown in properties_of(parameter, declared)]
    if kind.times_from is not None or kind.time_steps is not Filter.time_steps:
        # ParaView's animation gets the time steps by this property.
        times = Element("DoubleVectorProperty", name="TimestepValues", repeatable="1", information_only="1")
        SubElement(times, "TimeStepsInformationHelper")
        parts.append(times)
    if len(kind.output_ports) > 1:
        parts += [
            Element("OutputPort", index=str(number), name=camel_case(port.name), id=f"port{number}")
            for number, port in enumerate(kind.output_ports)
        ]
    return [tostring(part, encoding="unicode") for part in parts]


def proxy_hints(kind: type[Filter]) -> list[str]:
    """Return XML hints of a proxy: menu and file type."""
    hints = [Element("ShowInMenu", category=CATEGORY)]
    for parameter in kind.parameter_declarations.values():
        if parameter.kind in FILES and not kind.input_ports:
            file = FILES[parameter.kind]
            words = {"extensions": file.extensions, "file_description": f"Muscle: {file.description}"}
            hints.append(Element("ReaderFactory", words))
    return [tostring(hint, encoding="unicode") for hint in hints]


def _documentation(kind: type[Filter]) -> Element:
    summary, _, rest = plain(split_docstring(kind.__doc__ or "")[0]).partition("\n\n")
    text = "\n\n".join(" ".join(paragraph.split()) for paragraph in rest.split("\n\n"))
    element = Element("Documentation", short_help=summary, long_help=summary)
    element.text = f"{summary}\n\n{text}".strip()
    return element


def _input(number: int, port: InputPort) -> Element:
    name = camel_case(port.name)
    element = _named("InputProperty", name, "SetInputConnection", port_index=str(number))
    groups = SubElement(element, "ProxyGroupDomain", name="groups")
    SubElement(groups, "Group", name="sources")
    SubElement(groups, "Group", name="filters")
    types = SubElement(element, "DataTypeDomain", name="input_type")
    SubElement(types, "DataType", value=port.type_name)
    SubElement(element, "Documentation").text = plain(port.doc)
    if port.optional:
        SubElement(SubElement(element, "Hints"), "Optional")
    return element
