"""Descriptions of filters for ParaView's server manager."""

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
from vtkmuscle.io.xml_elements import made
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


def clean(text: str) -> str:
    """Return help text without markup of reStructuredText."""
    return re.sub(r":\w+:`~?([^`]*)`", r"\1", text).replace("``", "")


def properties_of(parameter: Parameter[Any], among: Iterable[Parameter[Any]] = ()) -> list[Property]:
    """Return the properties of a parameter in order: 2 of an optional number, 1 of others."""
    properties = _properties_of(parameter)
    for shown in properties:
        if parameter.listed is not None:
            source = made("Property", name=camel_case(parameter.listed), function="StringInfo")
            shown.xml.append(made("StringListDomain", made("RequiredProperties", source), name="list"))
        if parameter.only_with:
            name, *values = parameter.only_with
            _show_only_with(shown.xml, camel_case(name), values)
        for other in among:
            setting = [choice for choice, group in other.sets.items() if parameter.name in group]
            if setting:
                _show_only_with(shown.xml, camel_case(other.name), setting, inverse="1")
    return properties


def informations_of(kind: type[Filter]) -> dict[str, Element]:
    """Return the read-only properties of a filter, by attribute. They are allowed texts and presets.

    Beside a preset ``Iterations`` keeps the user's number, ``IterationsInEffect`` is the effective number.
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
    return _named(f"{kind}VectorProperty", camel_case(attribute), "Get", information_only="1")


def _named(tag: str, name: str, verb: str, **more: str) -> Element:
    return made(tag, name=name, label=spaced(name), command=f"{verb}{name}", **more)


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
        xml.append(made("BooleanDomain", name="bool"))
    elif parameter.choices:
        choices = ("",) * (parameter.default is None) + parameter.choices
        xml.append(made("StringListDomain", *(made("String", value=each) for each in choices), name="list"))
    elif parameter.kind in _RANGES:
        least = parameter.above if parameter.minimum is None else parameter.minimum
        bounds = {"min": least, "max": parameter.maximum}
        # An integer as 1e+06 would be read as 1.
        written = {end: repr(parameter.kind(bound)) for end, bound in bounds.items() if bound is not None}
        xml.append(made(_RANGES[parameter.kind], name="range", **written))
    xml.append(_document(parameter))
    return xml


def _optional_number(name: str, parameter: Parameter[Any]) -> list[Property]:
    """Return a check box for None, and the number without None."""
    box = f"Automatic{name}"
    number = _vector(name, parameter, _first_number(parameter), 1)
    _show_only_with(number, box, ("0",))
    automatic = _element(box, "Int", True, 1)
    help_text = f"Leave {spaced(name)} to the filter (None in Python)."
    automatic.extend([made("BooleanDomain", name="bool"), made("Documentation", help_text)])

    def take(state: dict[str, Any], value: Any, changed: str) -> Any:
        state[changed] = value
        return None if state.get(box, True) else state.get(name, _first_number(parameter))

    take_box, take_number = partial(take, changed=box), partial(take, changed=name)
    return [Property(box, automatic, take_box), Property(name, number, take_number)]


def _show_only_with(xml: Element, other: str, values: Sequence[str], **more: str) -> None:
    """Show a property only for values of another."""
    if (hints := xml.find("Hints")) is None:
        hints = SubElement(xml, "Hints")
    shown = {"mode": "visibility", "property": other, "values": " ".join(values), **more}
    hints.append(made("PropertyWidgetDecorator", type="GenericDecorator", **shown))


def _first_number(parameter: Parameter[Any]) -> Any:
    """Return the initial number, within the parameter's bounds."""
    number = max(1.0, parameter.minimum or 0.0, 2.0 * (parameter.above or 0.0))
    return parameter.kind(number if parameter.maximum is None else min(number, parameter.maximum))


def _file_property(name: str, parameter: Parameter[Any], file: _File) -> Property:
    xml = _element(name, "String", "", 1)
    words = _document(parameter, f" Given by {file.description}; empty for none.")
    chooser = made("FileChooser", extensions=file.extensions, file_description=file.description)
    xml.extend([made("FileListDomain", name="files"), words, made("Hints", chooser)])
    return Property(name, xml, lambda state, path: file.read(Path(path)) if path else None)


def _element(name: str, kind: str, default: Any, count: int) -> Element:
    values = default if isinstance(default, tuple) else (default,)
    texts = [str(int(value)) if isinstance(value, bool) else str(value) for value in values]
    sizes = {"number_of_elements": str(count), "default_values": " ".join(texts)}
    return _named(f"{kind}VectorProperty", name, "Set", **sizes)


def _document(parameter: Parameter[Any], more: str = "") -> Element:
    return made("Documentation", f"{clean(described(parameter))}{more}")


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
        flags = {"name": "TimestepValues", "repeatable": "1", "information_only": "1"}
        parts.append(made("DoubleVectorProperty", made("TimeStepsInformationHelper"), **flags))
    if len(kind.output_ports) > 1:
        parts += [
            made("OutputPort", index=str(number), name=camel_case(port.name), id=f"port{number}")
            for number, port in enumerate(kind.output_ports)
        ]
    return [tostring(part, encoding="unicode") for part in parts]


def proxy_hints(kind: type[Filter]) -> list[str]:
    """Return XML hints of a proxy: menu and file type."""
    hints = [made("ShowInMenu", category=CATEGORY)]
    for parameter in kind.parameter_declarations.values():
        if parameter.kind in FILES and not kind.input_ports:
            file = FILES[parameter.kind]
            words = {"extensions": file.extensions, "file_description": f"Muscle: {file.description}"}
            hints.append(made("ReaderFactory", **words))
    return [tostring(hint, encoding="unicode") for hint in hints]


def _documentation(kind: type[Filter]) -> Element:
    summary, _, rest = clean(split_docstring(kind.__doc__ or "")[0]).partition("\n\n")
    text = "\n\n".join(" ".join(paragraph.split()) for paragraph in rest.split("\n\n"))
    return made("Documentation", f"{summary}\n\n{text}".strip(), short_help=summary, long_help=summary)


def _input(number: int, port: InputPort) -> Element:
    name = camel_case(port.name)
    words = {"label": spaced(name), "command": "SetInputConnection", "port_index": str(number)}
    element = made("InputProperty", name=name, **words)
    groups = [made("Group", name=group) for group in ("sources", "filters")]
    types = made("DataTypeDomain", made("DataType", value=port.type_name), name="input_type")
    about = made("Documentation", clean(port.doc))
    element.extend([made("ProxyGroupDomain", *groups, name="groups"), types, about])
    if port.optional:
        element.append(made("Hints", made("Optional")))
    return element
