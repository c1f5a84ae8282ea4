"""Limits of the checks, with reasons.

Beyond a limit a muscle needs a look, or has failed.
"""

from __future__ import annotations

from dataclasses import dataclass

#: Limits that are lengths hold for muscles of this size or larger (diagonal of the box at rest) [mm], and are
#: in proportion less for smaller ones.
FULL_SIZE = 100.0

# A muscle exerts no active force below half of its optimal length, nor above 1.6 to 1.7 times of it: Zajac
# 1989, "Muscle and tendon", Crit Rev Biomed Eng 17:359; Gordon, Huxley, Julian 1966,
# doi:10.1113/jphysiol.1966.sp007909 (sarcomeres of 1.27 and 3.65 um, where the optimum is 2.05 to 2.2). Half
# as much again is what no fibre survives.
SHORTEST, LONGEST = 0.5, 1.6
BEYOND = 1.5


@dataclass(frozen=True)
class Check:
    """A check of each frame against two limits.

    Results beyond ``look`` need a look; results beyond ``failed`` are useless. ``says`` is the problem, with
    the value as ``{}``, and ``do`` the remedy. With ``smaller``, small values are bad.
    """

    look: float
    failed: float
    unit: str
    says: str
    do: str
    smaller: bool = False


#: Remedies of several checks.
ROUGH = "look at its surface there; quality = 'accurate' makes it smoother, and a mesh of even triangles"
MOTION = "check its attachments, and whether the motion is one that the joint can do"
FIBRES = "check its attachments, or take other fibres (method = 'harmonic', or aponeuroses)"
CLOSED = "look whether the bone is closed, and whether the muscle is squeezed between two bones"

#: The limits of each check, with the reasons for them: from where on results need a look, from where on they
#: are of no use, and the unit.
LIMITS = {
    # Kohout and Cervenka 2021 (doi:10.1007/978-3-030-72379-8_24), Fig. 11: less than 1 % with few iterations;
    # 5 % is seen by eye.
    "volume": (1.0, 5.0, "%"),
    # They are set, not solved for: anything but rounding is a fault.
    "fixed points": (0.01, 1.0, "mm"),
    # A surface is stretched and squeezed as the fibres in it. Of muscles that move well up to 3.2 % of the
    # area is beyond what no fibre survives; where they crumpled or have a crease it was 6.6 to 10.4 %.
    "misshapen": (5.0, 25.0, "%"),
    # Where muscles move well the 95th percentile is up to 20 degrees over 90 of the joint; where they crumple
    # it is 36 to 61.
    "crumpled": (30.0, 45.0, "deg"),
    # An edge whose triangles lie on each other, and did not at rest. Few are a crease, as in a groin.
    "folded": (0.5, 3.0, "%"),
    "long fibres": (LONGEST, BEYOND * LONGEST, ""),
    "short fibres": (SHORTEST, SHORTEST / BEYOND, ""),
    # A jump of 1 mm from one frame to the next is a moment arm that is wrong by 57 mm at steps of 1 degree.
    # One fibre of a hundred may snap over an edge, and hardly changes the mean.
    "jumps": (1.0, 100.0, "mm"),
    # A muscle that buckled made jumps of 18 mm in all of its fibres.
    "widespread jumps": (1.0, 5.0, "mm"),
    # Of a fibre whose length jumps: what moves straight off a bone, as a strap that lifts, is not aside.
    # Beyond 100 mm it is on another bone.
    "slid off": (2.0, 100.0, "mm"),
    # Of muscles whose fibres are well by eye up to a sixth of the neighbours change sides, where they run
    # together in a tip; of a sheet whose fibres go to the other edge nine tenths do.
    "crossed fibres": (30.0, 60.0, "%"),
    "hooked fibres": (5.0, 50.0, "%"),
    # A muscle that winds once round a bone turns by 360 degrees, and none does: the iliacus turns by 195.
    "winding fibres": (270.0, 540.0, "deg"),
    # Farther from any fibre than neighbours are from each other in the belly. Fibres that fill their muscle
    # leave up to a twentieth, in its corners; those between aponeuroses a quarter, beyond these.
    "bare": (50.0, 90.0, "%"),
    # A path that bends round a bone of 16 mm sinks into it by 0.01 mm; ten times that and it is pressed ten
    # times harder than by its own pull. Of the muscles of a hip, a knee and an elbow none lacks any room; one
    # under a roof of bone lacks 1.1 mm, if the arm is raised and the shoulder blade does not turn with it.
    "squeezed": (0.1, 5.0, "mm"),
    # Lengths and moment arms of such a frame are left out: one in twenty leaves the curves whole. Where paths
    # do not come to rest before the motion begins, all frames are left out.
    "unsettled": (0.0, 5.0, "%"),
    # FibreTransport keeps points to rounding inside where the muscle does not fold; at rest 0.5 mm counts as
    # inside. A fibre that is 15 mm off is anywhere.
    "fibres outside": (0.5, 15.0, "mm"),
    # 15 mm deep is the middle of a femur's shaft.
    "fibres in bone": (1.0, 15.0, "mm"),
    # What is promised is 0.1 mm (95th percentile); a point 5 mm deep has gone through a thin bone.
    "penetration": (0.5, 5.0, "mm"),
    "widespread penetration": (0.1, 1.0, "mm"),
}

#: The words of each check: the problem, with the value as ``{}``, and the remedy.
WORDS = {
    "volume": ("its volume is off by {}", ROUGH),
    "fixed points": ("a point that is fixed to a bone is {} off it", "report this: it is a fault"),
    "misshapen": (
        f"{{}} of its surface is stretched {BEYOND * LONGEST:g} times in a direction, or squeezed to a third",
        "look at the surface there; spikes come from badly shaped triangles, so remesh it",
    ),
    "crumpled": ("the surface is crumpled: one in twenty edges is bent by {} since rest, or more", ROUGH),
    "folded": ("{} of its edges are folded back and were not at rest", ROUGH),
    "long fibres": ("one in twenty fibres is {} times as long as at rest, or more", MOTION),
    "short fibres": ("one in twenty fibres is {} times as long as at rest, or less", MOTION),
    "jumps": ("a fibre's length jumps by {}: it snaps over a bone", "do not use its moment arms about there"),
    "widespread jumps": (
        "the lengths of one in twenty fibres jump by {} or more: the muscle buckles or snaps over a bone",
        "do not use moment arms about there; its attachments, or a via ring (role = 'via'), may hold it",
    ),
    "slid off": (
        "a fibre slides off a bone sideways, by {} in one step",
        "hold the muscle there as its tissue does, by a via ring on that bone (role = 'via'), or correct its "
        "attachments; do not use moment arms from there on",
    ),
    "crossed fibres": ("{} of neighbouring fibres change sides at an end of the muscle, at rest", FIBRES),
    "hooked fibres": ("{} of the fibres have a hook at rest", FIBRES),
    "winding fibres": ("one fibre in twenty turns by {} in all at rest, or more", FIBRES),
    "bare": (
        "{} of its volume have no fibres at rest",
        "check its attachments; without aponeuroses take course = 'sections'",
    ),
    "squeezed": (
        "one in twenty of its paths lacks {} of room between two bones, or more",
        "check the motion there: a bone that should go along stands still, or a joint's centre is off",
    ),
    "unsettled": (
        "its paths do not come to rest in {} of the frames, and have no lengths and moment arms there",
        "check its attachments and the bones there: are they closed, and do they leave the muscle room?",
    ),
    "fibres outside": (
        "a fibre is {} outside of the muscle",
        "look at the fibres there, and do not use those that are outside",
    ),
    "fibres in bone": (
        "a fibre is {} deeper in a bone than at rest",
        "look at the fibres there, and do not use those that run through the bone",
    ),
    "penetration": ("a point is {} deeper in a bone than at rest", CLOSED),
    "widespread penetration": (
        "one in twenty free points is {} deeper in a bone than at rest, or more",
        CLOSED,
    ),
}

#: The checks by name; of fibres that are too short small values are bad.
CHECKS = {
    name: Check(*limits, *WORDS[name], smaller=name == "short fibres") for name, limits in LIMITS.items()
}
