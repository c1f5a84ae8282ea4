"""Phantoms with known answers: those of the package, and those that only tests and benchmarks need."""

from phantoms.ball_spindle import spindle_over_ball
from phantoms.brim_flexor import flexor_over_brim
from phantoms.fibre_blocks import fibre_block
from phantoms.lifting_strap import lifting_strap
from phantoms.ring_tendon import tendon_through_ring
from phantoms.slivered_tendon import slivered_tendon
from phantoms.two_joint_strap import strap_over_two_joints
from phantoms.winding_spindle import winding_spindle
from vtkmuscle.phantoms import (
    Phantom,
    hip,
    leg,
    pennate_belly,
    pennate_block,
    spindle_over_hinge,
    wrapping_cylinder,
)

__all__ = [
    "Phantom",
    "fibre_block",
    "flexor_over_brim",
    "hip",
    "leg",
    "lifting_strap",
    "pennate_belly",
    "pennate_block",
    "slivered_tendon",
    "spindle_over_ball",
    "spindle_over_hinge",
    "strap_over_two_joints",
    "tendon_through_ring",
    "winding_spindle",
    "wrapping_cylinder",
]
