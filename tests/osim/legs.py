"""A leg with oblique and moved hinges, a slide, a coupled patella and a fixed foot."""

from vtkmuscle.core.motion.rigid import frame_at
from vtkmuscle.joints.functions import IDENTITY, Polynomial
from vtkmuscle.joints.tree import Coupling, Joint, JointAxis, JointCoordinate, KinematicTree


def leg(*knee_slides):
    """Return the tree of a leg whose knee also slides along `knee_slides`."""
    hip = Joint(
        "hip_joint",
        "ground",
        "femur",
        [JointAxis((0.1, 0.2, 1), IDENTITY, "hip"), JointAxis((1, 0, 0), IDENTITY, "adduction")],
        [JointAxis((0, 1, 0), IDENTITY, "pull"), JointAxis((1, 0, 0), Polynomial([0.02]))],
        parent_frame=frame_at((0.1, 0.9, 0.0), (0.1, -0.4, 0.2)),
        child_frame=frame_at((0.0, 0.05, 0.01), (0.3, 0.1, 0.0)),
    )
    bending = [
        JointAxis((0, 0, 1), IDENTITY, "knee"),
        JointAxis((1, 0, 0), Polynomial([0.05, 0.1, 0.0]), "knee"),
    ]
    at_knee = frame_at((0.0, -0.4, 0.0))
    sliding = [JointAxis((0, 0, 1), IDENTITY, "slide")]
    joints = [
        hip,
        Joint("knee_joint", "femur", "tibia", bending, knee_slides, parent_frame=at_knee),
        Joint("patella_joint", "femur", "patella", sliding, parent_frame=at_knee),
        Joint("ankle_joint", "tibia", "foot", parent_frame=frame_at((0.02, -0.4, 0.0), (0.1, 0.2, 0.3))),
    ]
    names = [JointCoordinate(name, range=(-2.0, 2.0)) for name in ("hip", "adduction", "knee", "slide")]
    following = Coupling("slide", "knee", Polynomial([0.6, 0.05]))
    return KinematicTree("ground", joints, [*names, JointCoordinate("pull", "m")], [following])
