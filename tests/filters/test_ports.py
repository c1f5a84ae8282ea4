"""Ports by name, chains, times: how filters are connected and asked."""

import pickle

import numpy as np
import pytest
import pyvista as pv
from test_base import Clock, line, x_of
from vtkmodules.util.execution_model import select_ports
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkCleanPolyData
from vtkmodules.vtkFiltersSources import vtkLineSource

from vtkmuscle.data.arrays import blocks_of, multiblock_from, points_of, with_points
from vtkmuscle.filters import Filter, InputPort, OutputPort, Parameter
from vtkmuscle.filters.base.running import Chain


class Add(Filter):
    """Add the first points of two lines, and the time."""

    factor = Parameter(float, default=1.0, doc="Of the second one.")
    power = Parameter(float, default=1.0, only_with=("mode", "hard"), doc="Unused.")
    mode: Parameter[str | None] = Parameter(
        str,
        default=None,
        choices=("soft", "hard"),
        sets={"soft": {"factor": 2.0}, "hard": {"factor": 3.0, "power": 2.0}},
        doc="A group.",
    )

    first = InputPort(vtkPolyData, doc="Points.")
    second = InputPort(vtkPolyData, optional=True, doc="Points.")
    output = OutputPort(vtkPolyData, doc="Points.")

    def execute(self, first, second):
        more = 0.0 if second is None else x_of(second)
        return with_points(first, points_of(first) + np.array([self.factor * more, 0.0, 0.0]))


class Blocks(Filter):
    """Give the blocks that it gets."""

    blocks = InputPort(vtkMultiBlockDataSet, doc="Blocks.")
    output = OutputPort(vtkMultiBlockDataSet, doc="The same.")

    def execute(self, blocks):
        return blocks


# -------------------------------------------------------------------- names


def test_ports_are_keywords_and_attributes():
    add = Add(first=line(1.0), second=line(10.0), factor=2.0)
    assert x_of(add.output) == 21.0
    add.second = line(20.0)
    assert x_of(add.output) == 41.0
    add.second = None
    assert add.second is None
    assert x_of(add.output) == 1.0


def test_a_port_reads_as_what_is_connected():
    data, source = line(1.0), vtkLineSource()
    add = Add(first=data, second=source)
    assert add.first is data
    assert add.second is source
    again = Add(first=add.first, second=add.second)
    assert again.second is source


@pytest.mark.parametrize(
    ("make", "x"),
    [
        (lambda: vtkLineSource(point1=(4, 0, 0)), 4.0),
        (lambda: vtkLineSource(point1=(4, 0, 0)) >> vtkCleanPolyData(), 4.0),
        (lambda: line(3.0) >> vtkCleanPolyData() >> Add(second=line(1.0)), 4.0),
        (lambda: select_ports(Add(first=line(4.0)), 0), 4.0),
        (lambda: pv.Line((4, 0, 0), (4, 0, 1)), 4.0),
    ],
    ids=["VTK's source", "VTK's chain", "chain", "selected port", "PyVista's data"],
)
def test_an_input_is_data_an_algorithm_or_a_chain(make, x):
    assert x_of(Add(first=make()).output) == x
    assert x_of(Add().apply(make())) == x
    source = vtkLineSource(point1=(5, 0, 0))
    assert x_of(Add(first=source.GetOutputPort()).output) == 5.0


@pytest.mark.parametrize("name", ["firts", "factr", "outputs"])
def test_an_unknown_name_is_refused_with_the_nearest_one(name):
    nearest = {"firts": "first", "factr": "factor"}.get(name)
    meant = f"did you mean {nearest!r}. allowed: first, " if nearest else "allowed: first"
    with pytest.raises(AttributeError, match=f"Add has no parameter or input port {name!r}; .*{meant}"):
        setattr(Add(), name, 1.0)
    with pytest.raises(TypeError, match=f"Add has no parameter or input port {name!r}; .*{meant}"):
        Add(**{name: 1.0})


def test_an_unknown_port_is_refused():
    add, source = Add(), vtkLineSource()
    for port in (2, -1):
        with pytest.raises(IndexError, match=rf"no input port {port}; its input ports are 0 \(first\), 1"):
            add.connect(port, line(1.0))
        with pytest.raises(IndexError, match="no input port"):
            add.SetInputConnection(port, source.GetOutputPort())
    with pytest.raises(AttributeError, match=r"no input port 'secnd'; did you mean 'second'"):
        add.connect("secnd", line(1.0))


@pytest.mark.parametrize(
    "wrong",
    [3, "mesh", [1.0], {"a": vtkPolyData()}, vtkMultiBlockDataSet(), Blocks(), Clock],
    ids=lambda value: type(value).__name__,
)
def test_a_wrong_kind_is_refused_at_once(wrong):
    add = Add(first=line(1.0))
    for set_it in (
        lambda: setattr(add, "first", wrong),
        lambda: Add(first=wrong),
        lambda: add.apply(wrong),
        lambda: add.SetInputData(wrong),
    ):
        with pytest.raises(TypeError, match=r"Add\.first is .*, but must be a vtkPolyData, an algorithm or"):
            set_it()
    assert x_of(add.output) == 1.0


def test_named_data_sets_may_be_a_dict_or_a_multiblock():
    given = {"a": line(1.0), "b": line(2.0)}
    for value in (given, multiblock_from(given), pv.MultiBlock(given)):
        found = Blocks(blocks=value).output
        assert [(name, x_of(block)) for name, block in blocks_of(found)] == [("a", 1.0), ("b", 2.0)]


def test_named_algorithms_may_be_a_dict():
    clock = Clock()
    blocks = Blocks(blocks={"now": clock, "there": line(7.0)})
    for time in (0.5, 2.0):
        assert [x_of(block) for _, block in blocks_of(blocks(time=time))] == [time, 7.0]
    with pytest.raises(TypeError, match=r"Blocks\.blocks is .*, but must be a vtkMultiBlockDataSet, a dict"):
        Blocks(blocks={"now": clock, "there": 3})


# -------------------------------------------------------------------- chains


def test_a_chain_is_used_like_a_filter():
    source = vtkLineSource(point1=(1, 0, 0))
    chain = Add(first=source) >> vtkCleanPolyData() >> Add(second=line(10.0))
    assert isinstance(chain, Chain)
    assert x_of(chain.output) == x_of(chain.update().output) == x_of(chain.apply()) == 11.0
    assert isinstance(chain.apply(), pv.PolyData)
    assert x_of((Add(second=line(1.0)) >> vtkCleanPolyData()).apply(line(1.0))) == 2.0
    assert x_of((vtkCleanPolyData() >> Add())(line(3.0))) == 3.0
    for ended in (source >> vtkCleanPolyData() >> Add(), source >> (Add() >> vtkCleanPolyData())):
        assert x_of(ended.update().output) == 1.0  # VTK's own


def test_a_chain_is_made_of_algorithms():
    for wrong in (3, line(1.0), None):
        with pytest.raises(TypeError, match=r"Add\(.*>> .*: a chain is made of"):
            Add() >> wrong


def test_a_chain_on_data_leaves_its_connections():
    chain = Add(first=line(1.0)) >> vtkCleanPolyData()
    assert x_of(chain(line(5.0))) == 5.0
    with pytest.raises(ValueError, match="no points"):
        chain(vtkPolyData())
    assert x_of(chain.output) == 1.0
    with pytest.raises(TypeError, match=r"Add\.first is"):
        chain(3)
    with pytest.raises(TypeError, match=r"Add has 2 input port\(s\), got 3 inputs"):
        chain(line(1.0), line(1.0), line(1.0))


# -------------------------------------------------------------------- time


def test_without_a_time_the_last_step_is_given():
    clock = Clock()
    assert clock.time is None
    for found in (clock(), clock.apply(), clock.output, (Clock() >> Add()).output):
        assert x_of(found) == 2.0
    direct = Clock()
    direct.Update()
    assert x_of(direct.GetOutput()) == 2.0


def test_without_a_time_another_branch_says_nothing():
    clock = Clock()
    one, other = Add(first=clock), Add(first=clock)
    assert x_of(one.update(time=0.5).output) == 0.5
    assert x_of(other.output) == 2.0
    assert x_of(one.output) == 0.5


def test_a_time_that_was_asked_for_stays():
    clock, chain = Clock(), Clock() >> Add()
    for asked in (clock, chain):
        assert x_of(asked.apply(time=0.5)) == 0.5
        assert asked.time == 0.5
        assert x_of(asked.output) == x_of(asked()) == 0.5
        asked.time = 0.0
        assert x_of(asked.output) == 0.0
        asked.time = None
        assert x_of(asked.output) == 2.0
        assert x_of(asked(time=0.5)) == 0.5


# -------------------------------------------------------------------- groups and conditions


def test_a_group_sets_its_parameters_and_what_is_given_counts_more():
    assert Add(mode="soft").factor == 2.0
    assert Add(factor=7.0, mode="hard").parameters() == {"factor": 7.0, "power": 2.0, "mode": "hard"}
    add = Add()
    add.mode = "hard"
    assert (add.factor, add.power) == (3.0, 2.0)
    add.factor = 5.0
    assert (add.mode, add.factor) == ("hard", 5.0)
    assert pickle.loads(pickle.dumps(add)).parameters() == add.parameters()
    assert Add(**add.parameters()).parameters() == add.parameters()
    add.mode = "hard"
    assert add.factor == 3.0
    add.mode = None
    assert add.factor == 3.0


def test_what_does_not_count_is_said_and_left_out():
    assert "power : a finite number, default: 1.0\n    Unused. Counts only with mode 'hard'." in Add.__doc__
    assert "power" not in Add().parameters_that_count()
    assert "power" in Add(mode="hard").parameters_that_count()


@pytest.mark.parametrize(
    "wrong",
    [{"only_with": ("nothing", "x")}, {"only_with": ("mode", "mild")}, {"sets": {"a": {"nothing": 1}}}],
    ids=["no such parameter", "no such value", "no such parameter to set"],
)
def test_a_declaration_that_refers_to_nothing_is_refused(wrong):
    with pytest.raises((TypeError, ValueError), match=r"Bad[:.]"):
        type("Bad", (Add,), {"odd": Parameter(str, default="a", choices=("a",), doc="Odd.", **wrong)})
