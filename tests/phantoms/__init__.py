"""Phantoms with known answers: those of the package, of the examples, and of tests and benchmarks."""

import sys
from pathlib import Path

sys.path += [str(Path(__file__).parents[2] / "examples" / group) for group in ("joints", "fibres")]

from belly import pennate_belly
from leg import leg

from phantoms.ball_spindle import spindle_over_ball
from phantoms.brim_flexor import flexor_over_brim
from phantoms.fibre_blocks import block_sheets, fibre_block
from phantoms.label_maps import label_map
from phantoms.lifting_strap import lifting_strap
from phantoms.pulleys import (
    broad_origin,
    strap_along_bone,
    strap_beside_bone,
    tendon_between_bones,
    tendon_under_band,
)
from phantoms.ring_tendon import tendon_through_ring
from phantoms.slivered_tendon import slivered_tendon
from phantoms.two_joint_strap import strap_over_two_joints
from phantoms.winding_strap import winding_strap
from vtkmuscle.phantoms import Phantom, hip, pennate_block, spindle_over_hinge, wrapping_cylinder

__all__ = [
    "Phantom", "block_sheets", "broad_origin", "fibre_block", "flexor_over_brim", "hip", "label_map", "leg",
    "lifting_strap", "pennate_belly", "pennate_block", "slivered_tendon", "spindle_over_ball",
    "spindle_over_hinge", "strap_along_bone", "strap_beside_bone", "strap_over_two_joints",
    "tendon_between_bones", "tendon_through_ring", "tendon_under_band", "winding_strap", "wrapping_cylinder",
]  # fmt: skip
