"""Procedural muscles and joints with known answers: the embedded data, made when asked for."""

from __future__ import annotations

from vtkmuscle.phantoms.ball_spindle import spindle_over_ball
from vtkmuscle.phantoms.brim_flexor import flexor_over_brim
from vtkmuscle.phantoms.cylinder_wrap import wrapping_cylinder
from vtkmuscle.phantoms.fibre_blocks import fibre_block, pennate_block
from vtkmuscle.phantoms.hinge_spindle import spindle_over_hinge
from vtkmuscle.phantoms.hip_joint import hip
from vtkmuscle.phantoms.lifting_strap import lifting_strap
from vtkmuscle.phantoms.phantom import Phantom
from vtkmuscle.phantoms.ring_tendon import tendon_through_ring
from vtkmuscle.phantoms.slivered_tendon import slivered_tendon
from vtkmuscle.phantoms.two_joint_strap import strap_over_two_joints
from vtkmuscle.phantoms.winding_spindle import winding_spindle

__all__ = [
    "Phantom",
    "fibre_block",
    "flexor_over_brim",
    "hip",
    "lifting_strap",
    "pennate_block",
    "slivered_tendon",
    "spindle_over_ball",
    "spindle_over_hinge",
    "strap_over_two_joints",
    "tendon_through_ring",
    "winding_spindle",
    "wrapping_cylinder",
]
