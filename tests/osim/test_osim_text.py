"""What is written for OpenSim is what OpenSim reads: transforms, lengths and moment arms."""

import importlib.util
from xml.etree import ElementTree

import numpy as np
import osim_texts as texts
import pytest
from legs import leg

from vtkmuscle.joints import grid_of
from vtkmuscle.joints.functions import CubicSpline, PiecewiseLinear, Polynomial
from vtkmuscle.joints.tree import JointAxis
from vtkmuscle.opensim import MuscleOut, enriched, osim_of, read_osim
from vtkmuscle.opensim.export_parts import fit_length
from vtkmuscle.opensim.muscle_paths import PathPoint, PointPath, moment_arm

needs_opensim = pytest.mark.skipif(
    importlib.util.find_spec("opensim") is None, reason="the extra opensim is not installed"
)


KNEE_SLIDES = (
    JointAxis((1, 0, 0), CubicSpline([-2, -1, 0, 1, 2], [0.01, 0.005, 0, 0.004, 0.006]), "knee"),
    JointAxis((0, 1, 0), PiecewiseLinear([-2, -0.23, 2], [1, 0, 2]).rescaled(1.0, 0.003), "knee"),
)
LEG = leg(*KNEE_SLIDES)
GRID = grid_of({"hip": np.linspace(-0.5, 1.0, 5), "knee": np.linspace(-1.5, 0.5, 5)})


def muscles():
    points = PointPath(
        [
            PathPoint("ground", (0.05, 1.0, 0.02)),
            PathPoint("femur", (0.05, -0.38, 0.0), only_in=("knee", -2.0, -0.3)),
            PathPoint("patella", (0.06, 0.01, 0.0)),
            PathPoint("foot", (0.03, 0.3, 0.0)),
        ]
    )
    spline = CubicSpline(np.linspace(-2, 2, 6), [0.05, 0.052, 0.06, 0.058, 0.05, 0.04])
    moving = PointPath(
        [
            PathPoint("femur", (0.05, -0.1, 0.0)),
            PathPoint("tibia", (0.0, 0.02, 0.01), (spline, None, Polynomial([0.002, 0.01])), ("knee",) * 3),
        ]
    )
    function = fit_length(points.lengths(LEG, GRID), GRID)
    return [
        MuscleOut("over_points", points, {"max_isometric_force": 900.0, "optimal_fiber_length": 0.08}),
        MuscleOut("moving", moving, kind="Thelen2003Muscle"),
        MuscleOut("by_function", function, {"pennation_angle_at_optimal": 0.2}, "DeGrooteFregly2016Muscle"),
        MuscleOut("without_force", function, kind="PathActuator"),
    ]


def test_a_written_model_is_read_again_as_it_was(tmp_path):
    path = tmp_path / "leg.osim"
    path.write_text(osim_of(LEG, muscles(), name='a "leg" & more'))
    again = read_osim(path)
    assert again.name == 'a "leg" & more'
    before, after = LEG.poses(GRID), again.tree.poses(GRID)
    for body in before:
        np.testing.assert_allclose(after[body], before[body], atol=1e-12)
    for muscle in muscles():
        lengths = muscle.path.lengths(LEG, GRID)
        np.testing.assert_allclose(
            again.muscle(muscle.name).path.lengths(again.tree, GRID), lengths, atol=1e-12
        )
    assert again.muscle("over_points").parameters["max_isometric_force"] == 900.0


@needs_opensim
@pytest.mark.parametrize("way", ["new", "into a model"])
def test_opensim_has_the_same_lengths_and_moment_arms(tmp_path, way):
    import opensim

    opensim.Logger.setLevelString("error")
    path = tmp_path / "leg.osim"
    if way == "new":
        path.write_text(osim_of(LEG, muscles()))
    else:
        (tmp_path / "bare.osim").write_text(osim_of(LEG))
        path.write_text(enriched(tmp_path / "bare.osim", muscles()))
    model = opensim.Model(str(path))
    state, coordinates = model.initSystem(), model.updCoordinateSet()
    for i in range(0, 25, 4):
        for name in GRID:
            coordinates.get(name).setValue(state, float(GRID[name][i]), False)
        model.assemble(state)
        model.realizePosition(state)
        now = {name: column[i : i + 1] for name, column in GRID.items()}
        for muscle in muscles():
            theirs = opensim.PathActuator.safeDownCast(model.getForceSet().get(muscle.name)).getPath()
            assert theirs.getLength(state) == pytest.approx(muscle.path.lengths(LEG, now)[0], abs=1e-5)
            for name in muscle.path.coordinates(LEG):
                arm = theirs.computeMomentArm(state, coordinates.get(name))
                assert arm == pytest.approx(moment_arm(muscle.path, LEG, now, name)[0], abs=1e-4)


def test_muscles_are_put_into_a_model_that_stays_as_it_is(tmp_path):
    bare = tmp_path / "bare.osim"
    bare.write_text(texts.model_4(forces=texts.muscle("")).replace("leg", "caf\u00e9"), encoding="utf-8")
    path = PointPath([PathPoint("femur", (0, 0, 0)), PathPoint("tibia", (0, 0, 0))])
    text = enriched(bare, [MuscleOut("new", path)])
    assert "caf\u00e9" in text
    (tmp_path / "more.osim").write_text(text, encoding="utf-8")
    more, plain = (ElementTree.fromstring(one.encode()) for one in (text, bare.read_text(encoding="utf-8")))
    forces = more.find("Model/ForceSet/objects")
    forces.remove(forces[-1])
    assert [(one.tag, one.attrib) for one in more.iter()] == [(one.tag, one.attrib) for one in plain.iter()]
    assert [(one.text or "").split() for one in more.iter()] == [
        (one.text or "").split() for one in plain.iter()
    ]
    assert list(read_osim(tmp_path / "more.osim").muscles) == ["vastus", "new"]
    with pytest.raises(ValueError, match="has a muscle 'vastus' already"):
        enriched(bare, [MuscleOut("vastus", path)])
    (tmp_path / "less.osim").write_text(enriched(bare, [MuscleOut("vastus", path)], replace=["vastus"]))
    assert read_osim(tmp_path / "less.osim").muscle("vastus").kind == "Millard2012EquilibriumMuscle"


def test_what_opensim_cannot_take_is_told(tmp_path):
    path = PointPath([PathPoint("femur"), PathPoint("nobody")])
    with pytest.raises(ValueError, match="no body 'nobody'"):
        osim_of(LEG, [MuscleOut("m", path)])
    with pytest.raises(ValueError, match="'a muscle' is no name for a muscle"):
        MuscleOut("a muscle", path)
    with pytest.raises(ValueError, match="no kind of muscle"):
        MuscleOut("m", path, kind="Hill")
    (tmp_path / "old.osim").write_bytes(texts.model_3().encode("latin-1"))
    with pytest.raises(ValueError, match="version 30000"):
        enriched(tmp_path / "old.osim", [])
