"""What is read of a model is what OpenSim itself makes of it (extra ``opensim``)."""

import numpy as np
import osim_texts as texts
import pytest

from vtkmuscle.opensim import read_motion_file, read_osim
from vtkmuscle.opensim.muscle_paths import moment_arm

opensim = pytest.importorskip("opensim", reason="the extra opensim is not installed")
opensim.Logger.setLevelString("error")


def off_opensim(model, values, every=1):
    """Return the largest differences of positions [m], rotations [rad], lengths [m] and moment arms [m]."""
    ours, theirs = read_osim(model), opensim.Model(str(model))
    state = theirs.initSystem()
    coordinates, muscles = theirs.updCoordinateSet(), theirs.getMuscles()
    poses = ours.tree.poses(values)
    paths = {name: one.path for name, one in ours.muscles.items() if not getattr(one.path, "wraps", ())}
    lengths = {name: path.lengths(ours.tree, values) for name, path in paths.items()}
    off = np.zeros(4)
    for i in range(0, len(next(iter(values.values()))), every):
        for name in ours.tree.free:
            if name in values:
                coordinates.get(name).setLocked(state, False)
                coordinates.get(name).setValue(state, float(values[name][i]), False)
        theirs.assemble(state)
        theirs.realizePosition(state)
        for body in ours.tree.bodies[1:]:
            frame = theirs.getBodySet().get(body).getTransformInGround(state)
            turn = np.array([[frame.R().get(a, b) for b in range(3)] for a in range(3)])
            place = np.array([frame.p().get(a) for a in range(3)])
            off[0] = max(off[0], np.abs(place - poses[body][i][:3, 3]).max())
            between = turn.T @ poses[body][i][:3, :3]
            skew = np.array(
                [between[2, 1] - between[1, 2], between[0, 2] - between[2, 0], between[1, 0] - between[0, 1]]
            )
            off[1] = max(off[1], np.arcsin(min(1.0, 0.5 * np.linalg.norm(skew))))
        for name, path in paths.items():
            theirs_path = muscles.get(name).getPath()
            off[2] = max(off[2], abs(theirs_path.getLength(state) - lengths[name][i]))
            if i % (20 * every) == 0:
                now = {one: value[i : i + 1] for one, value in values.items()}
                for one in path.coordinates(ours.tree):
                    arm = theirs_path.computeMomentArm(state, coordinates.get(one))
                    off[3] = max(off[3], abs(arm - moment_arm(path, ours.tree, now, one)[0]))
    return off


def test_gait2392_walks_as_in_opensim(opensim_data):
    path = opensim_data / "gait2392_thelen2003muscle.osim"
    walk = read_motion_file(opensim_data / "subject01_walk1_ik.mot")
    assert len(walk.times) == 211
    off = off_opensim(path, walk.values(read_osim(path).tree), every=10)
    assert (off < [1e-6, 1e-6, 1e-5, 1e-4]).all(), off


def test_arm26_moves_as_in_opensim(opensim_data):
    path = opensim_data / "arm26.osim"
    sweep = {one.name: np.linspace(-0.3, 1.2, 7) for one in read_osim(path).tree.coordinates}
    off = off_opensim(path, sweep)
    assert (off < [1e-6, 1e-6, 1e-5, 1e-4]).all(), off


def test_straight_lines_of_the_real_hip_have_opensims_moment_arms(lhdl_hip):
    path = lhdl_hip / "reference" / "LHDL_hip_r.osim"
    values = read_motion_file(lhdl_hip / "motions" / "hip_flexion_osim_-10_90.mot").values(
        read_osim(path).tree
    )
    off = off_opensim(path, {name: value[::5] for name, value in values.items()})
    assert (off < 1e-6).all(), off  # arms: 1e-3 mm


def test_all_kinds_of_joints_are_opensims(tmp_path, rng):
    model = opensim.Model()
    model.setName("kinds")
    kinds = ["Weld", "Pin", "Slider", "Universal", "Ball", "Gimbal", "Planar", "Free"]
    parent = model.getGround()
    for number, kind in enumerate(kinds):
        body = opensim.Body(f"b{number}", 1.0, opensim.Vec3(0), opensim.Inertia(1, 1, 1, 0, 0, 0))
        place, turn, back, turned = (opensim.Vec3(*map(float, rng.uniform(-0.5, 0.5, 3))) for _ in range(4))
        make = getattr(opensim, f"{kind}Joint")
        joint = make(f"j{number}", parent, place, turn, body, back, turned)
        model.addBody(body)
        model.addJoint(joint)
        parent = body
    model.finalizeConnections()
    path = tmp_path / "kinds.osim"
    model.printToXML(str(path))
    tree = read_osim(path).tree
    values = {one.name: rng.uniform(-0.7, 0.7, 4) for one in tree.coordinates}
    assert len(values) == sum([0, 1, 1, 2, 3, 3, 3, 6])
    off = off_opensim(path, values)
    assert (off < 1e-9).all(), off


@pytest.mark.parametrize(
    "muscle",
    [
        texts.muscle(""),
        # OpenSim's moment arms leave out segments within one body, so a moving point is the last one here.
        texts.muscle(texts.MOVING, last=""),
        texts.muscle(texts.CONDITIONAL),
    ],
)
def test_functions_and_points_of_paths_are_opensims(tmp_path, muscle):
    path = tmp_path / "leg.osim"
    path.write_text(texts.model_4(forces=muscle))
    off = off_opensim(path, {"knee_angle": np.linspace(-1.9, 1.9, 21), "hip_x": np.linspace(-1, 1, 21)})
    assert (off < [1e-9, 1e-9, 1e-9, 1e-7]).all(), off
    # Beyond the range a moving point stays, in OpenSim too; its moment arm there does as if it moved.
    off = off_opensim(path, {"knee_angle": np.linspace(-2.5, 2.5, 21)})
    assert (off[:3] < 1e-9).all(), off


def test_version_3_is_opensims(tmp_path):
    path = tmp_path / "leg.osim"
    path.write_bytes(texts.model_3().replace("\xe9", "e").encode())
    off = off_opensim(path, {"knee_angle": np.linspace(-2, 2, 5)})
    assert (off < 1e-9).all(), off
