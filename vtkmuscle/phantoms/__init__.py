"""Procedural muscles and joints with known answers, made on call: the package has no other data.

Joints, from the simplest to the most lifelike, with their known answers in brackets:

* :func:`spindle_over_hinge` (length and moment arm of the straight line);
* :func:`wrapping_cylinder`, a strap wound up and unwound (one moment arm at every angle);
* :func:`hip`, the demo's: pelvis, femur and three muscles (the head of the femur); :func:`leg`: three
  joints, ten muscles.

Fibres: :func:`fibre_block`, :func:`pennate_block` and :func:`pennate_belly` (lengths, pennation).

:func:`label_map` makes an image of labels of any of them (the surfaces behind the voxels).
"""

from __future__ import annotations

from vtkmuscle.phantoms.fibre_bodies import fibre_block, pennate_belly, pennate_block
from vtkmuscle.phantoms.hip_joint import hip
from vtkmuscle.phantoms.leg import leg
from vtkmuscle.phantoms.one_hinge import spindle_over_hinge, wrapping_cylinder
from vtkmuscle.phantoms.phantom import Phantom, label_map

__all__ = [
    "Phantom",
    "fibre_block",
    "hip",
    "label_map",
    "leg",
    "pennate_belly",
    "pennate_block",
    "spindle_over_hinge",
    "wrapping_cylinder",
]
