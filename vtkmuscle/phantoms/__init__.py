"""Procedural muscles and joints with known answers.

The phantoms are made on call: the package has no other data. Joints, from the simplest to the most lifelike,
with the known answers in brackets:

* :func:`spindle_over_hinge` (length and moment arm of the straight line);
* :func:`wrapping_cylinder`, a strap wound up and unwound (one moment arm at every angle);
* :func:`hip`, the demo's: pelvis, femur and three muscles (the head of the femur).

Fibres: :func:`fibre_block` and :func:`pennate_block` (lengths, pennation).
"""

from vtkmuscle.phantoms.fibre_bodies import fibre_block, pennate_block
from vtkmuscle.phantoms.hip_joint import hip
from vtkmuscle.phantoms.one_hinge import spindle_over_hinge, wrapping_cylinder
from vtkmuscle.phantoms.phantom import Phantom

__all__ = ["Phantom", "fibre_block", "hip", "pennate_block", "spindle_over_hinge", "wrapping_cylinder"]
