"""ParaView's properties against the declarations they are made from."""

import json
from functools import cache
from xml.etree.ElementTree import fromstring

import pytest
from commands import python

from vtkmuscle import filters
from vtkmuscle.paraview.proxies import FILES, camel_case, clean, informations_of, properties_of, proxy_parts
from vtkmuscle.paraview.shells import all_kinds, shell_of

KINDS = all_kinds()
every_filter = pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)


@cache
def parts(kind):
    return [fromstring(part) for part in proxy_parts(kind)]


def named(elements, name):
    (found,) = [element for element in elements if element.get("name") == name]
    return found


def test_all_kinds_are_in_the_plugin():
    assert {"BoneMotion", "TautPaths", "PathDeformer", "PBDDeformer", "FibreTubes", "MuscleScene"} <= {
        kind.__name__ for kind in KINDS
    }
    assert filters.Filter not in KINDS


@every_filter
def test_properties_say_what_is_declared(kind):
    for parameter in kind.parameter_declarations.values():
        check_property(kind, parameter)


def check_property(kind, parameter):
    name = camel_case(parameter.name)
    xml = named(parts(kind), name)
    assert xml.get("command") == f"Set{name}"
    assert clean(parameter.doc) in xml.findtext("Documentation")
    assert parameter.units in xml.findtext("Documentation")
    defaults = xml.get("default_values").split(" ")
    assert len(defaults) == int(xml.get("number_of_elements")) == (parameter.length or 1)
    if parameter.kind is tuple:
        assert tuple(map(float, defaults)) == parameter.default
    elif parameter.kind is bool:
        assert defaults == [str(int(parameter.default))]
        assert xml.find("BooleanDomain") is not None
    elif parameter.kind in FILES:
        assert defaults == [""]
        assert xml.find("Hints/FileChooser").get("extensions") == FILES[parameter.kind].extensions
    elif parameter.default is not None:
        assert parameter.kind(defaults[0]) == parameter.default
    listed = tuple(choice.get("value") for choice in xml.iter("String"))
    assert listed == ("",) * (bool(parameter.choices) and parameter.default is None) + parameter.choices
    domain = xml.find("IntRangeDomain" if parameter.kind is int else "DoubleRangeDomain")
    if parameter.kind in (int, float):
        lowest = parameter.above if parameter.minimum is None else parameter.minimum
        for bound, value in (("min", lowest), ("max", parameter.maximum)):
            text = domain.get(bound)
            # ParaView reads the integer 1e+06 as 1; int() refuses it.
            assert (None if text is None else parameter.kind(text)) == value
    if parameter.kind in (int, float) and parameter.default is None:
        assert named(parts(kind), f"Automatic{name}").get("default_values") == "1"
        parameter.check(parameter.kind(defaults[0]), kind.__name__)


@every_filter
def test_nothing_else_is_in_the_proxy(kind):
    names = [part.get("name") for part in parts(kind)]
    expected = [None, *(camel_case(port.name) for port in kind.input_ports)]
    expected += [information.get("name") for information in informations_of(kind).values()]
    for parameter in kind.parameter_declarations.values():
        optional = parameter.kind in (int, float) and parameter.default is None
        expected += [f"Automatic{camel_case(parameter.name)}"] * optional + [camel_case(parameter.name)]
    timed = kind.times_from is not None or kind.time_steps is not filters.Filter.time_steps
    expected += ["TimestepValues"] * timed
    if len(kind.output_ports) > 1:
        expected += [camel_case(port.name) for port in kind.output_ports]
    assert names == expected
    assert len(set(names)) == len(names)


def test_a_preset_shows_in_the_values_that_count():
    shown = parts(filters.PathDeformer)
    assert named(shown, "IterationsInEffect").attrib["information_only"] == "1"
    deformer = shell_of(filters.PathDeformer, __name__)(quality="preview")
    assert deformer.GetIterationsInEffect() == deformer.iterations == 2


def test_what_does_not_count_is_hidden():
    shown = parts(filters.FixedPointDetector)
    voxels = named(shown, "NVoxels").find("Hints/PropertyWidgetDecorator").attrib
    assert (voxels["property"], voxels["values"], voxels["mode"]) == ("Method", "collision", "visibility")
    for kind, name in ((filters.TautPaths, "Resolution"), (filters.PathDeformer, "Iterations")):
        (ruled,) = named(parts(kind), name).iter("PropertyWidgetDecorator")
        decoration = ruled.get("property"), ruled.get("values"), ruled.get("inverse")
        assert decoration == ("Quality", "preview balanced accurate", "1")
    assert named(parts(filters.PathDeformer), "MeasurePenetration").find("Hints") is None


@every_filter
def test_inputs_say_what_is_declared(kind):
    for number, port in enumerate(kind.input_ports):
        xml = named(parts(kind), camel_case(port.name))
        assert xml.get("port_index") == str(number)
        assert xml.find("DataTypeDomain/DataType").get("value") == port.type_name
        assert (xml.find("Hints/Optional") is not None) == port.optional
        assert xml.findtext("Documentation") == clean(port.doc)


@every_filter
def test_help_is_the_docstring(kind):
    help_ = parts(kind)[0]
    first = kind.__doc__.partition("\n")[0]
    assert help_.get("short_help") == clean(first)
    assert help_.text.startswith(clean(first))
    assert "Parameters" not in help_.text
    assert "``" not in help_.text


def test_several_outputs_are_named():
    class Two(filters.Filter):
        """Give two things."""

        first = filters.OutputPort(filters.Filter, doc="One.")
        second = filters.OutputPort(filters.Filter, doc="Other.")

    ports = [part for part in parts(Two) if part.tag == "OutputPort"]
    assert [(port.get("index"), port.get("name")) for port in ports] == [("0", "First"), ("1", "Second")]


def test_a_kind_without_property_or_file_is_refused():
    class Odd(filters.Filter):
        """Take something odd."""

        thing = filters.Parameter(dict, default=None, doc="Odd.")
        input = filters.InputPort(filters.Filter, doc="X.")

    with pytest.raises(TypeError, match=r"'thing' is a dict.*FILES"):
        properties_of(Odd.parameter_declarations["thing"])


def test_filters_and_plugin_import_neither_pyvista_nor_paraview():
    script = (
        "import json, sys, vtkmuscle.paraview.environment, vtkmuscle.scene.reading\n"
        "import vtkmuscle.paraview.shells as s\n"
        "[s.shell_of(kind, 'm') for kind in s.all_kinds()]\n"
        "print(json.dumps(sorted(sys.modules)))"
    )
    modules = json.loads(python("-c", script).stdout)
    loaded = {name.partition(".")[0] for name in modules}
    assert "vtkmuscle" in loaded
    assert not loaded & {"pyvista", "paraview", "matplotlib", "vtk", "typer", "rich"}
    assert not [name for name in modules if name.startswith("vtkmodules.vtkRendering")]
