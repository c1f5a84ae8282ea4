"""The strap over two hinges as a scene with joints, for tests."""

import shutil
import tomllib

import tomli_w
from phantoms import strap_over_two_joints
from phantoms.planar import flexed
from phantoms.two_joint_strap import AXIS, LOWER, WRAPS

from vtkmuscle import Scene

CENTRE = [0.0, *map(float, flexed(LOWER, -WRAPS[0]))]
HIP = {"parent": "proximal", "child": "middle", "type": "pin", "centre": [0.0, 0.0, 0.0], "axis": list(AXIS)}
KNEE = {"parent": "middle", "child": "distal", "type": "pin", "centre": CENTRE, "axis": [-x for x in AXIS]}
JOINTS = {
    "hip": HIP | {"coordinates": {"upper": {"range": [-40, 60], "positive": "flexion"}}},
    "knee": KNEE | {"coordinates": ["lower"]},
}
#: The joints of a model of OpenSim in their place.
BODIES = {"proximal": "ground", "middle": "femur", "distal": "tibia"}
OPENSIM = {"bodies": BODIES, "frame": "femur", "fixed": "femur"}


def save_strap(folder, *, n_fibres=8, resolution=20):
    """Write the strap's scene, with its motion as tables."""
    phantom = strap_over_two_joints()
    return Scene.from_phantom(phantom, n_fibres=n_fibres, resolution=resolution).save(folder)


def scene_with(folder, tmp_path, **changes):
    """Copy the strap's scene, with joints and other tables; return its file."""
    made = tmp_path / "scene"
    shutil.copytree(folder, made)
    tables = tomllib.loads((made / "scene.toml").read_text())
    tables |= {"joints": JOINTS} | changes
    tables = {name: value for name, value in tables.items() if value is not None}
    (made / "scene.toml").write_text(tomli_w.dumps(tables))
    return made / "scene.toml"
