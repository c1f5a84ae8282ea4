"""Filters under test: what they are run on, and what their outputs hold."""

import functools
import hashlib
import math

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonCore import vtkAbstractArray, vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkImageData, vtkMultiBlockDataSet, vtkPolyData

from examples import OBJECTS, TIMES, deep_copy, example
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.data.arrays import blocks_of, field_array, point_array, points_of, triangles_of, vtk_points
from vtkmuscle.data.pipeline_times import announce_times
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.ports import InputPort, OutputPort

#: Arrays that say how a result came about, not what it is: they differ from run to run, or by parameters that
#: change nothing else.
HOW_IT_WAS_MADE = {"Provenance"}


def digest(data):
    """Return a hash of all that a data object holds, how it was made left out."""
    hashed = hashlib.sha256(data.GetClassName().encode())
    if isinstance(data, vtkMultiBlockDataSet):
        for name, block in blocks_of(data):
            hashed.update(f"{name}: {None if block is None else digest(block)}".encode())
    else:
        hashed.update(points_of(data).tobytes())
        cells_of = ("GetVerts", "GetLines", "GetPolys", "GetStrips") if isinstance(data, vtkPolyData) else ()
        for cells in (getattr(data, name)() for name in cells_of):
            for array in (cells.GetOffsetsArray(), cells.GetConnectivityArray()):
                hashed.update(vtk_to_numpy(array).astype(np.int64).tobytes())
        for attributes in (data.GetPointData(), data.GetCellData()):
            _hash_arrays(hashed, attributes)
    _hash_arrays(hashed, data.GetFieldData())
    return hashed.hexdigest()


def _hash_arrays(hashed, attributes):
    for i in range(attributes.GetNumberOfArrays()):
        array = attributes.GetAbstractArray(i)
        if array.GetName() in HOW_IT_WAS_MADE:
            continue
        hashed.update(f"{array.GetName()} {array.GetClassName()} {array.GetNumberOfComponents()}".encode())
        hashed.update(values_of(array).tobytes())


def values_of(array: vtkAbstractArray):
    if isinstance(array, vtkStringArray):
        return np.array([array.GetValue(i) for i in range(array.GetNumberOfValues())])
    return vtk_to_numpy(array)


def leaves(data):
    """Return the data sets in a data object."""
    if isinstance(data, vtkMultiBlockDataSet):
        return [leaf for _, block in blocks_of(data) if block is not None for leaf in leaves(block)]
    return [data]


def is_empty(data):
    return data.GetNumberOfElements(vtkDataObject.POINT) == 0


def poisoned(data):
    """Return a copy whose first point is not a number."""
    copy = deep_copy(data)
    leaf = leaves(copy)[0]
    if isinstance(leaf, vtkImageData):
        leaf.SetOrigin(math.nan, 0.0, 0.0)
        return copy
    points = points_of(leaf)
    points[0] = math.nan
    leaf.SetPoints(vtk_points(points))
    return copy


class Timed(VTKPythonAlgorithmBase):
    """A source that announces times, and makes the data of the time asked for; notes the times."""

    def __init__(self, make, times=TIMES):
        self.make, self.times, self.asked = make, [float(time) for time in times], []
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType=make(self.times[0]).GetClassName())

    def RequestInformation(self, request, in_info, out_info):
        announce_times(out_info.GetInformationObject(0), self.times)
        return 1

    def RequestData(self, request, in_info, out_info):
        info = out_info.GetInformationObject(0)
        key = self.GetExecutive().UPDATE_TIME_STEP()
        self.asked.append(info.Get(key) if info.Has(key) else self.times[0])
        output = info.Get(vtkDataObject.DATA_OBJECT())
        output.ShallowCopy(self.make(self.asked[-1]))
        output.GetInformation().Set(vtkDataObject.DATA_TIME_STEP(), self.asked[-1])
        return 1


class PassOn(Filter):
    """Give the input on, whatever it is."""

    anything = InputPort(vtkDataObject, doc="Data.")
    output = OutputPort(vtkPolyData, doc="The same.")

    def execute(self, anything):
        return anything if anything.IsA("vtkPolyData") else vtkPolyData()


class Case:
    """A filter class and what it is run on."""

    def __init__(self, kind):
        self.kind = kind
        self.declarations = kind.parameter_declarations
        self.ports = kind.input_ports

    def parameters(self):
        """Return values for the parameters that are objects; the others keep their defaults."""
        return {
            name: OBJECTS[declaration.kind]
            for name, declaration in self.declarations.items()
            if declaration.kind in OBJECTS
        }

    def inputs(self):
        return [example(self.kind, port) for port in self.ports]

    def filter(self, *inputs, **parameters):
        """Return a new filter, connected to data."""
        new = self.kind(**{**self.parameters(), **parameters})
        for port, data in enumerate(inputs):
            new.connect(port, data)
        return new

    def timed(self, still=0):
        """Return a new filter whose inputs announce time steps, but the first few."""
        sources = [Timed(functools.partial(example, self.kind, port)) for port in self.ports[still:]]
        return self.filter(*(example(self.kind, port) for port in self.ports[:still]), *sources)

    def reference(self):
        """Return the hashes of the outputs for the example; all ways of running are compared with them."""
        return _reference(self.kind)


@functools.cache
def _reference(kind):
    case = Case(kind)
    return digests(case.filter(*case.inputs()))


def digests(algorithm, **request):
    """Bring a filter up to date, and return the hashes of its outputs."""
    return results_digests(algorithm.update(**request).output)


def results_digests(results):
    return [digest(data) for data in (results if isinstance(results, tuple) else (results,))]


def check_carried(out, rest, transforms):
    """Check that fixed points follow their bones, and that the volume is kept, and reported."""
    now, before, triangles = points_of(out), points_of(rest), triangles_of(rest, "")
    marks = point_array(rest, "FixedTo", "")
    for bone, transform in enumerate(transforms):
        expected = apply_transform(transform, before[marks == bone])
        np.testing.assert_allclose(now[marks == bone], expected, rtol=0.0, atol=1e-9)
    volume = signed_volume(now, triangles) / signed_volume(before, triangles)
    assert volume == pytest.approx(1.0, abs=1e-9)
    assert field_array(out, "VolumeRatio")[0] == pytest.approx(volume, rel=1e-9)


def check_shape_report(out):
    """Check that a report of a bent muscle's shape is there, and is plausible."""
    stretch = [field_array(out, f"EdgeStretch{name}")[0] for name in ("P95", "Max")]
    assert 0.5 < stretch[0] < stretch[1] < 5.0
    assert 0.0 < field_array(out, "DihedralErrorP95")[0] < 90.0
    assert field_array(out, "DegenerateEdges")[0] == 0


def count_executions(algorithm):
    """Return a list that grows with each execution of the filter."""
    calls, execute = [], algorithm.execute

    def counted(*inputs):
        calls.append(len(calls))
        return execute(*inputs)

    algorithm.execute = counted
    return calls


def other_value(declaration, value):
    """Return an allowed value that differs from the one given, or that one if it is the only choice."""
    if declaration.choices:
        return next((choice for choice in declaration.choices if choice != value), value)
    if declaration.kind is bool:
        return not value
    if declaration.kind is tuple:
        return tuple(component + 1.0 for component in value)
    if declaration.kind is str:
        return f"{value} too"
    if declaration.kind not in (int, float):
        return OBJECTS[declaration.kind] if value is None else None
    start = value if value is not None else (declaration.minimum or 0)
    candidates = [start + 1, start - 1, start / 2 if declaration.kind is float else start]
    for candidate in candidates:
        try:
            if declaration.check(declaration.kind(candidate), "") != value:
                return declaration.kind(candidate)
        except ValueError:
            continue
    raise AssertionError(f"no other value found for {declaration.name}")
