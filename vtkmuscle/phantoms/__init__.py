"""Procedural muscles and joints with known answers: the embedded data, made when asked for.

Joints, from the simplest to the most like life; with what is known of the muscle's middle line in brackets:

* :func:`spindle_over_hinge` (length and moment arm of the straight line) and :func:`spindle_over_ball` (the
  same in flexion and abduction);
* :func:`wrapping_cylinder`, a strap wound up and unwound (one moment arm at every angle);
* :func:`lifting_strap`, which leaves the bone that it wraps (the angle, length and moment arm on both sides);
* :func:`flexor_over_brim`, in a groove in front of the joint (length and moment arm, where those of the
  straight line have the wrong sign);
* :func:`strap_over_two_joints`, with two coordinates (length, a moment arm about each joint);
* :func:`tendon_through_ring`, held by a via ring (length and moment arm with the ring and without);
* :func:`slivered_tendon`, badly shaped triangles pulled round an edge (length);
* :func:`hip`, the demo's: pelvis, femur and three muscles (the head of the femur); :func:`leg`, the whole of
  it: three joints, ten muscles.

Fibres: :func:`fibre_block`, :func:`pennate_block` and :func:`pennate_belly` (lengths, pennation),
:func:`winding_spindle` (twist).
"""

from __future__ import annotations

from vtkmuscle.phantoms.ball_spindle import spindle_over_ball
from vtkmuscle.phantoms.brim_flexor import flexor_over_brim
from vtkmuscle.phantoms.cylinder_wrap import wrapping_cylinder
from vtkmuscle.phantoms.fibre_blocks import fibre_block, pennate_block
from vtkmuscle.phantoms.hinge_spindle import spindle_over_hinge
from vtkmuscle.phantoms.hip_joint import hip
from vtkmuscle.phantoms.leg import leg
from vtkmuscle.phantoms.lifting_strap import lifting_strap
from vtkmuscle.phantoms.pennate_belly import pennate_belly
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
