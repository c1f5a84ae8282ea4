"""The setters that ParaView calls, without ParaView."""

import ast
import gc
import re
from pathlib import Path

import numpy as np
import pytest
from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow
from vtkmodules.vtkCommonDataModel import vtkPolyData

import vtkmuscle
from vtkmuscle import Scene
from vtkmuscle.data.arrays import blocks_of, points_of
from vtkmuscle.filters import BoneMotion, FibreTemplateSource, FixedPointDetector, PathDeformer
from vtkmuscle.filters.base import Filter, OutputPort, Parameter
from vtkmuscle.paraview.proxies import properties_of
from vtkmuscle.paraview.shells import MuscleScene, all_kinds, shell_of


class Pushed(Filter):
    """Parameters of kinds that few filters have."""

    force = Parameter(tuple, default=(0.0, 0.0, 0.0), length=3, doc="A vector.")
    method = Parameter(str, default="on", choices=("on", "off"), doc="A choice.")
    output = OutputPort(vtkPolyData, doc="Nothing.")


def shell(kind):
    return shell_of(kind, __name__)()


@pytest.fixture
def messages():
    """What VTK would show, as a function."""
    window, before = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
    vtkOutputWindow.SetInstance(window)
    yield window.GetOutput
    vtkOutputWindow.SetInstance(before)


@pytest.mark.parametrize("room", ["data", "filters", "io", "paraview", "scene"])
def test_objects_of_vtk_are_made_without_keywords_for_the_vtk_of_paraview(room):
    for path in (Path(vtkmuscle.__file__).parent / room).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and re.match("vtk[A-Z]", ast.unparse(node.func)):
                assert not node.keywords, f"{path}, line {node.lineno}"


@pytest.mark.parametrize("kind", all_kinds(), ids=lambda kind: kind.__name__)
def test_defaults_from_paraview_change_nothing(kind):
    made = shell(kind)
    before, modified = made.parameters(), made.GetMTime()
    for parameter in kind.parameter_declarations.values():
        for shown in properties_of(parameter):
            texts = shown.xml.get("default_values").split(" ")
            number = {"Int": int, "Double": float, "String": str}[
                shown.xml.tag.removesuffix("VectorProperty")
            ]
            getattr(made, shown.command)(*map(number, texts))
    assert made.parameters() == before == kind().parameters()
    assert made.GetMTime() == modified


def test_setters_set():
    deformer, pushed = shell(PathDeformer), shell(Pushed)
    deformer.SetIterations(7)
    deformer.SetMeasurePenetration(1)
    deformer.SetBoneClearance(2.0)
    pushed.SetForce(0.0, 1.0, 2.0)
    pushed.SetMethod("off")
    assert deformer.iterations == 7
    assert deformer.measure_penetration is True
    assert deformer.bone_clearance == 2.0
    assert pushed.force == (0.0, 1.0, 2.0)
    assert pushed.method == "off"


def test_a_number_counts_when_it_is_not_automatic():
    detector = shell(FixedPointDetector)
    detector.SetDistance(2.5)
    assert detector.distance is None
    detector.SetAutomaticDistance(0)
    assert detector.distance == 2.5
    detector.SetDistance(0.0)
    assert detector.distance == 0.0
    detector.SetAutomaticDistance(1)
    assert detector.distance is None


def test_quality_rules_over_what_paraview_sets_beside_it():
    deformer = shell(PathDeformer)
    defaults = deformer.parameters()
    deformer.SetIterations(7)
    deformer.SetQuality("preview")
    deformer.SetIterations(12)  # hidden then, but a state file sets it
    assert deformer.parameters() == PathDeformer(quality="preview").parameters()
    deformer.SetQuality("accurate")
    assert deformer.parameters() == PathDeformer(quality="accurate").parameters()
    deformer.SetQuality("")
    assert deformer.parameters() == {**defaults, "iterations": 12}


def test_a_motion_is_read_from_its_scene(spindle, tmp_path):
    path = Scene.from_phantom(spindle).save(tmp_path)
    motion = shell(BoneMotion)
    motion.SetMotion(str(path))
    assert motion.motion.times.tolist() == spindle.motion.times.tolist()
    assert list(motion.motion.transforms) == list(spindle.motion.transforms)
    motion.SetMotion("")
    assert motion.motion is None


def test_a_refused_value_makes_the_filter_fail_until_it_is_replaced(messages):
    source = shell(FibreTemplateSource)
    source.SetNFibres(0)
    for _ in range(2):
        source.Modified()
        assert not source.GetExecutive().Update()
        assert source.GetOutputDataObject(0).GetNumberOfPoints() == 0
    assert messages().count("FibreTemplateSource: n_fibres is 0, but must be an integer >= 1") == 2
    source.SetNFibres(5)
    assert source.GetExecutive().Update()
    assert source.GetOutputDataObject(0).GetNumberOfCells() == 5


def test_a_scene_gives_a_muscle_by_name(messages, hip, tmp_path):
    path = Scene.from_phantom(hip).save(tmp_path)
    source = shell(MuscleScene)
    source.SetScene(str(path))
    first, *_, last = hip.muscles
    for name, asked in ((first, ""), (last, last), (first, None)):
        source.SetMuscle(asked)
        surface, bones, attachments = source.surface, source.bones, source.attachments
        assert source.GetMuscleNames() == list(hip.muscles)
        assert np.array_equal(points_of(surface), points_of(hip.muscles[name]))
        assert list(dict(blocks_of(bones))) == list(dict(blocks_of(hip.bones)))
        assert attachments.GetNumberOfBlocks() == hip.attachments[name].GetNumberOfBlocks()
    source.SetMuscle("no such")
    assert not source.GetExecutive().Update()
    assert f"there is no muscle 'no such' in the scene; allowed: {first}" in messages()


def test_a_file_that_is_not_there_is_named(messages, spindle):
    motion = shell(BoneMotion)
    motion.connect(0, spindle.bones)
    motion.SetMotion("no/such/scene.toml")
    assert not motion.GetExecutive().Update()
    assert "no/such/scene.toml: there is no such file" in messages()


def test_a_shell_that_failed_outlives_its_python_side(messages):
    """ParaView holds the VTK side only; what the Python side knows must not go with a collected cycle."""
    source = shell(FibreTemplateSource)
    port = source.GetOutputPort()
    source.SetNFibres(0)
    source.GetExecutive().Update()
    executive = source.GetExecutive()
    del source
    gc.collect()
    again = port.GetProducer()
    again.SetNFibres(3)
    assert executive.Update()
    assert again.n_fibres == 3
