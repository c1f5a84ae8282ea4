"""PathDeformer: what a muscle keeps that its paths carry, and its two outputs."""

import json

import numpy as np
import pytest
from filter_case import check_carried, check_shape_report

from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.data import arrays
from vtkmuscle.filters import BoneMotion, FixedPointDetector, PathDeformer, TautPaths
from vtkmuscle.filters.deformer import read_shape
from vtkmuscle.filters.path_deformer import ROUNDS
from vtkmuscle.phantoms import spindle_over_hinge, wrapping_cylinder
from vtkmuscle.pipelines import decompose

SPINDLE = spindle_over_hinge()
LAST = float(SPINDLE.motion.times[-1])


@pytest.fixture(scope="module")
def parts():
    """Return the muscle with its fixed points, and its fibres."""
    return fixed_and_fibres(SPINDLE, "spindle")


def fixed_and_fibres(phantom, name):
    areas = phantom.attachments[name]
    fixed = FixedPointDetector()(phantom.muscles[name], phantom.bones, areas)
    return fixed, decompose(fixed, areas, n_fibres=8).update().output


def chain(fixed, fibres=None, *, bones=SPINDLE.bones, motion=SPINDLE.motion, paths=True, **settings):
    """Return the deformer of a muscle whose paths are the fibres', or lines over its surface."""
    posed = {"rest_bones": bones, "bones": BoneMotion(bones=bones, motion=motion)}
    taut = TautPaths(rest_fibres=fibres, rest_muscle=fixed, **posed) if paths else None
    return PathDeformer(muscle=fixed, paths=taut, fibres=fibres, **posed, **settings)


def frame(deformer, time=LAST):
    return arrays.points_of(deformer.update(time=time).output)


def fibres_of(deformer, time=LAST):
    return arrays.shallow_copy(deformer.update(time=time, port=1).output)


# -------------------------------------------------------------------- the muscle


@pytest.mark.parametrize("quality", ROUNDS)
@pytest.mark.parametrize("paths", [True, False])
def test_fixed_points_follow_their_bone_and_the_volume_is_kept(parts, quality, paths):
    fixed, fibres = parts
    deformer = chain(fixed, fibres, quality=quality, paths=paths, measure_shape=True)
    for time in (0.0, 0.5 * LAST, LAST):
        moved = SPINDLE.motion.at(time)
        transforms = [moved.get(name, np.eye(4)) for name, _ in arrays.blocks_of(SPINDLE.bones)]
        check_carried(deformer.update(time=time).output, fixed, transforms)


def test_without_paths_the_blended_motion_of_the_bones_carries_the_muscle(parts):
    """And with them the paths do: the surface is another."""
    fixed, fibres = parts
    rest, marks = arrays.points_of(fixed), arrays.point_array(fixed, "FixedTo", "")
    with_bones, with_paths = (frame(chain(fixed, fibres, paths=paths)) for paths in (False, True))
    assert np.abs(with_bones - with_paths).max() > 0.5
    turned = {
        bone: apply_transform(SPINDLE.motion.at(LAST).get(name, np.eye(4)), rest)
        for bone, (name, _) in enumerate(arrays.blocks_of(SPINDLE.bones))
    }
    # Half way from one bone to the other the muscle is half way between where both would take it.
    middle = np.abs(rest[:, 2] - np.mean([rest[marks == bone, 2].mean() for bone in turned])) < 2.0
    halfway = 0.5 * (turned[0] + turned[1])[middle].mean(axis=0)
    apart = np.linalg.norm((turned[0] - turned[1])[middle].mean(axis=0))
    assert np.linalg.norm(with_bones[middle].mean(axis=0) - halfway) < 0.2 * apart


def test_displacement_and_report_are_those_of_the_frame(parts):
    deformer = chain(*parts)
    out = deformer.update(time=LAST).output
    np.testing.assert_allclose(
        arrays.point_array(out, "Displacement", ""),
        arrays.points_of(out) - arrays.points_of(parts[0]),
        atol=1e-9,
    )
    assert arrays.field_array(out, "VolumeRatio") is None, "nobody asked for the report"
    assert arrays.field_array(out, "PenetrationMax") is None
    before = arrays.points_of(out)
    deformer.measure_shape = deformer.measure_penetration = True
    out = deformer.update(time=LAST).output
    assert np.array_equal(arrays.points_of(out), before)
    assert json.dumps(read_shape(out, 1.0))
    check_shape_report(out)
    assert arrays.field_array(out, "PenetrationMax")[0] < 0.05


def test_the_clearance_keeps_free_points_off_the_bones():
    """The strap lies on the cylinder at rest and may stay as near there; elsewhere it keeps off."""
    phantom = wrapping_cylinder()
    fixed, fibres = fixed_and_fibres(phantom, "strap")
    free = arrays.point_array(fixed, "FixedTo", "") < 0
    time = float(phantom.motion.times[-1])
    posed = {"bones": phantom.bones, "motion": phantom.motion}
    radii = [
        np.linalg.norm(frame(chain(fixed, fibres, **posed, bone_clearance=gap), time)[free, 1:], axis=1)
        for gap in (0.0, 8.0)
    ]
    at_rest = np.linalg.norm(arrays.points_of(fixed)[free, 1:], axis=1)
    assert (radii[1] > np.minimum(at_rest, 33.0) - 0.3).all()
    assert not (radii[0] > np.minimum(at_rest, 33.0) - 0.3).all()


# -------------------------------------------------------------------- the fibres


def test_at_rest_fibres_are_the_own_fibres_with_their_arrays(parts):
    fixed, fibres = parts[0], arrays.shallow_copy(parts[1])
    arrays.add_arrays(fibres, cells={"Own": np.arange(float(fibres.GetNumberOfCells()))})
    out = fibres_of(chain(fixed, fibres), 0.0)
    lines = arrays.polylines_of(fibres, "")
    np.testing.assert_allclose(arrays.points_of(out), lines.points, rtol=0.0, atol=1e-6)
    assert np.array_equal(arrays.cell_array(out, "Own", ""), arrays.cell_array(fibres, "Own", ""))
    np.testing.assert_allclose(arrays.cell_array(out, "RestLength", ""), lines.lengths, rtol=1e-9)
    assert "PointsOutside" in arrays.names_of("", out.GetFieldData())


def test_fibres_go_with_their_paths_and_stay_in_the_muscle(parts):
    deformer = chain(*parts)
    fibres = arrays.polylines_of(fibres_of(deformer), "")
    paths = arrays.polylines_of(deformer.paths.update(time=LAST).output, "")
    for i in range(len(fibres)):
        for end in (0, -1):
            np.testing.assert_allclose(fibres.line(i)[end], paths.line(i)[end], rtol=0.0, atol=0.5)
        assert np.linalg.norm(fibres.line(i)[:, None] - paths.line(i)[None], axis=2).min(axis=1).max() < 4.0
    moved = arrays.points_of(fibres_of(deformer, LAST)) - arrays.points_of(fibres_of(deformer, 0.0))
    assert np.linalg.norm(moved, axis=1).max() > 10.0


def test_fibres_that_are_not_the_paths_own_are_refused_where_asked_for(parts):
    fixed, own = parts
    deformer = chain(fixed, own)
    deformer.fibres = decompose(fixed, SPINDLE.attachments["spindle"], n_fibres=5)
    with pytest.raises(ValueError, match=r"PathDeformer: fibres: there are 5 for 8 paths"):
        deformer.update(time=LAST, port=1)
    assert frame(deformer).shape == arrays.points_of(fixed).shape, "the muscle does not need them"
    with pytest.raises(ValueError, match=r"PathDeformer: fibres: there are 8 for no paths; connect"):
        chain(*parts, paths=False).update(time=LAST, port=1)


def test_without_fibres_the_second_output_is_empty(parts):
    """ParaView asks for all outputs."""
    assert fibres_of(chain(parts[0])).GetNumberOfPoints() == 0
