"""Names of bones and muscles, their sides, and the joints between bones."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

_SIDES = {"left": "left", "l": "left", "right": "right", "r": "right"}


@dataclass(frozen=True)
class JointKind:
    """A kind of joint between bones with certain words in their names; the first existing bone counts.

    ``form`` is ``"ball"``, ``"pin"`` or ``"weld"``; ``round_end``, ``"child"`` or ``"parent"``, has the round
    surface; ``axes`` (3,) are in LPS by coordinate, for a hanging right limb: a left limb reverses all axes
    but the first; ``most`` is the largest angle of the first coordinate [degrees].
    """

    name: str
    children: tuple[str, ...]
    parents: tuple[str, ...]
    form: str = "weld"
    round_end: str = "child"
    axes: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    most: float = 0.0


_FORWARD, _INWARD, _ABOUT = (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)
_FOOT = ("talus", "calcaneus", "foot", "tarsal", "tarsals", "metatarsal", "metatarsals", "phalanges")
_PELVIS = ("hip", "pelvis", "coxa", "coxae", "innominate", "ilium")
_HAND = ("hand", "carpal", "carpals", "metacarpal", "metacarpals")


def _three(joint: str) -> dict[str, tuple[float, float, float]]:
    return {f"{joint}_flexion": _FORWARD, f"{joint}_adduction": _INWARD, f"{joint}_rotation": _ABOUT}


#: Joints of the limbs; a patella follows the shank, as by its tendon.
JOINTS = (
    JointKind("hip", ("femur",), _PELVIS, "ball", axes=_three("hip"), most=60.0),
    JointKind("knee", ("tibia", "shank"), ("femur",), "pin", "parent", {"knee_flexion": (1.0, 0, 0)}, 60.0),
    JointKind("shoulder", ("humerus",), ("scapula",), "ball", axes=_three("shoulder"), most=60.0),
    JointKind("elbow", ("ulna", "forearm"), ("humerus",), "pin", "parent", {"elbow_flexion": _FORWARD}, 60.0),
    JointKind("fibula", ("fibula",), ("tibia",)),
    JointKind("patella", ("patella",), ("tibia", "shank")),
    JointKind("foot", _FOOT, ("tibia", "shank")),
    JointKind("radius", ("radius",), ("ulna",)),
    JointKind("hand", _HAND, ("ulna", "radius", "forearm")),
)


def plain_name(name: str) -> str:
    """Return a lower-case name with underscores, the side at the end."""
    words = re.findall(r"[a-z0-9]+", name.casefold())
    side = next((_SIDES[word] for word in words if word in _SIDES), None)
    rest = [word for word in words if word not in _SIDES]
    return "_".join([*rest, *([side] if side else [])]) or "unnamed"


def side_of(name: str) -> str | None:
    """Return ``"left"``, ``"right"``, or None for a name without side."""
    return next((side for side in ("left", "right") if plain_name(name).endswith(f"_{side}")), None)


def stem_of(name: str) -> str:
    """Return a plain name without side."""
    return re.sub(r"_(left|right)$", "", plain_name(name))
