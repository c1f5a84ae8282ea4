import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkFiltersCore import vtkPolyDataNormals
from vtkmodules.vtkFiltersSources import vtkCubeSource

from vtkmuscle.core.motion.rigid import apply_transform, hinge
from vtkmuscle.data.arrays import add_arrays, blocks_of, field_array, multiblock_from, point_array, points_of
from vtkmuscle.data.moving_bones import bones_of
from vtkmuscle.filters.bone_motion import BoneMotion

KNEE = hinge("tibia", (0.0, 0.0, 5.0), (1.0, 2.0, 0.0), [0.0, 30.0, 60.0])


def bone(centre=(0.0, 0.0, 0.0)):
    surface = (vtkCubeSource(center=centre) >> vtkPolyDataNormals(compute_cell_normals=True)).update().output
    add_arrays(surface, points={"Density": np.arange(surface.GetNumberOfPoints())}, fields={"Side": "right"})
    return surface


def at(motion, bones, time):
    motion.SetInputDataObject(0, bones)
    return motion.update(time).output


@pytest.fixture
def bones():
    return multiblock_from(
        {"femur": bone(), "tibia": bone((0.0, 0.0, 10.0)), "patella": bone((5.0, 0.0, 5.0))}
    )


@pytest.mark.parametrize("time", [0.0, 30.0, 41.5, 60.0])
def test_moving_bones_are_where_the_motion_has_them(bones, time):
    result = dict(blocks_of(at(BoneMotion(motion=KNEE), bones, time)))
    transform = KNEE.at(time)["tibia"]
    expected = apply_transform(transform, points_of(bones.GetBlock(1)))
    np.testing.assert_allclose(points_of(result["tibia"]), expected, atol=1e-12)
    np.testing.assert_allclose(field_array(result["tibia"], "Transform"), transform.reshape(-1), atol=0)
    assert result["tibia"].GetPoints().GetData().GetDataTypeAsString() == "double"


@pytest.mark.parametrize("name", ["Normals", None])
def test_normals_turn_with_the_bone_and_other_arrays_pass(bones, name):
    for attributes in (bones.GetBlock(1).GetPointData(), bones.GetBlock(1).GetCellData()):
        attributes.GetNormals().SetName(name)
    moved = at(BoneMotion(motion=KNEE), bones, 60.0).GetBlock(1)
    turn = KNEE.at(60.0)["tibia"][:3, :3]
    for kind in ("Point", "Cell"):
        owners = (getattr(block, f"Get{kind}Data")() for block in (bones.GetBlock(1), moved))
        before, after = (vtk_to_numpy(owner.GetNormals()) for owner in owners)
        np.testing.assert_allclose(after, before @ turn.T, atol=1e-6)
    np.testing.assert_array_equal(point_array(moved, "Density", "test"), np.arange(24))
    assert moved.GetFieldData().GetAbstractArray("Side").GetValue(0) == "right"


def test_what_is_done_to_the_output_is_gone_at_the_next_time(bones):
    motion = BoneMotion(motion=KNEE)
    for _, block in blocks_of(at(motion, bones, 0.0)):
        block.GetFieldData().Initialize()
        block.GetPointData().Initialize()
    for _, block in blocks_of(motion.update(30.0).output):
        assert field_array(block, "Transform") is not None
        assert len(point_array(block, "Density", "test"))


def test_other_bones_stay_and_share_their_geometry(bones):
    result = at(BoneMotion(motion=KNEE), bones, 60.0)
    for block in (0, 2):
        assert result.GetBlock(block).GetPoints() is bones.GetBlock(block).GetPoints()
        np.testing.assert_array_equal(field_array(result.GetBlock(block), "Transform"), np.eye(4).reshape(-1))
    assert field_array(bones.GetBlock(0), "Transform") is None


def test_the_times_of_the_motion_are_announced(bones):
    motion = BoneMotion(motion=KNEE, bones=bones)
    motion.UpdateInformation()
    info = motion.GetOutputInformation(0)
    assert info.Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS()) == (0.0, 30.0, 60.0)
    assert info.Get(vtkStreamingDemandDrivenPipeline.TIME_RANGE()) == (0.0, 60.0)
    motion.motion = None
    motion.UpdateInformation()
    assert not motion.GetOutputInformation(0).Has(vtkStreamingDemandDrivenPipeline.TIME_STEPS())


@pytest.mark.filterwarnings("ignore:.* is outside of the motion")
def test_before_and_after_the_motion_the_bones_stand_still(bones):
    motion = BoneMotion(motion=KNEE)
    for time, end in ((-10.0, 0.0), (1e6, 60.0)):
        found = field_array(at(motion, bones, time).GetBlock(1), "Transform")
        np.testing.assert_array_equal(found, KNEE.at(end)["tibia"].reshape(-1))


def test_blocks_that_are_no_bones_are_refused(bones):
    bones.SetBlock(1, vtkMultiBlockDataSet())
    with pytest.raises(ValueError, match="block 'tibia' is a vtkMultiBlockDataSet"):
        bones_of(bones, "test")
    bones.SetBlock(1, None)
    with pytest.raises(ValueError, match=r"block .* is empty"):
        bones_of(bones, "test")


def test_two_bones_of_one_name_are_refused(bones):
    bones.GetMetaData(2).Set(vtkMultiBlockDataSet.NAME(), "femur")
    with pytest.raises(ValueError, match="two blocks are named 'femur'"):
        bones_of(bones, "test")
