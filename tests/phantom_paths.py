"""Phantoms with paths in them, each made once, and the levers of their pull."""

from dataclasses import dataclass
from functools import cache

import numpy as np
import phantoms
from phantoms.ball_spindle import INSERTION, ORIGIN
from phantoms.brim_flexor import taut
from phantoms.lifting_strap import fibre
from phantoms.two_joint_strap import _middle_line

from vtkmuscle.core.bones.bone import bone_of
from vtkmuscle.core.mesh.polylines import evenly_spread
from vtkmuscle.core.motion.coordinates import twist_about
from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.core.paths.lines import bones_at_ends
from vtkmuscle.core.paths.sheet import POINTS, MusclePaths
from vtkmuscle.core.paths.via_rings import via_ring
from vtkmuscle.data.arrays import blocks_of, point_array, points_of, polylines_of, triangles_of
from vtkmuscle.data.attachments import attachments_of
from vtkmuscle.filters import FixedPointDetector
from vtkmuscle.phantoms.one_hinge import RADIUS, STRAIGHT, THICKNESS
from vtkmuscle.pipelines import decompose

#: Fibres in a phantom: enough to be everywhere in it.
FIBRES = 25

AXIS = np.array([-1.0, 0.0, 0.0])
#: Between poses [degrees].
STEP = 2.0

#: Of hinges about the x axis: the phantom, its settings, the bone that moves, from where to where [degrees].
HINGES = [
    ("wrapping_cylinder", {}, "pulley", -60.0, 80.0),
    ("lifting_strap", {}, "distal", 0.0, 70.0),
    ("flexor_over_brim", {"groove": 8.0}, "distal", 0.0, 80.0),
    ("flexor_over_brim", {"groove": -5.0}, "distal", 0.0, 80.0),
    ("tendon_through_ring", {}, "distal", 0.0, 60.0),
    ("spindle_over_ball", {}, "distal", -10.0, 60.0),
]


@dataclass(frozen=True, eq=False)
class Strung:
    """A phantom, its muscle and bones as arrays, and fibres (f, n, 3), evenly spread points."""

    phantom: phantoms.Phantom
    names: list
    points: np.ndarray
    triangles: np.ndarray
    fixed_to: np.ndarray
    fibres: np.ndarray
    start_bones: np.ndarray
    end_bones: np.ndarray
    bones: dict
    rings: tuple

    def pulled(self, **changed):
        """Return the paths at rest; fibres, start_bones, end_bones, bones, rings may be changed."""
        given = {
            "fibres": self.fibres,
            "start_bones": self.start_bones,
            "end_bones": self.end_bones,
            "bones": self.bones,
            "rings": self.rings,
            **changed,
        }
        ways = [given.pop(name) for name in ("fibres", "start_bones", "end_bones")]
        return MusclePaths(*ways, (self.points, self.triangles), given.pop("bones"), **given)

    def poses(self, motion=None):
        """Return the bones' transforms (k, b, 4, 4) at all times of a motion, by default the phantom's."""
        motion = self.phantom.motion if motion is None else motion
        return np.array(
            [[motion.at(time).get(name, np.eye(4)) for name in self.names] for time in motion.times]
        )


def strung(phantom, n_fibres=FIBRES, resolution=15):
    """Return a phantom with paths."""
    ((name, muscle),) = phantom.muscles.items()
    fibres = {"template": phantom.templates[name], "n_fibres": n_fibres, "resolution": resolution}
    return strung_muscle(muscle, phantom.bones, phantom.attachments[name], fibres=fibres, phantom=phantom)


def strung_muscle(muscle, blocks, areas, *, fibres, phantom=None, **fixing):
    """Return a muscle with paths; fibres are settings of decompose, fixing those of FixedPointDetector."""
    fixed = FixedPointDetector(**fixing)(muscle, blocks, areas)
    points, triangles = points_of(fixed), triangles_of(fixed, "test")
    fixed_to = point_array(fixed, "FixedTo", "test").astype(np.int64)
    lines = polylines_of(decompose(fixed, areas, **fibres).update().output, "test")
    fibres = evenly_spread(lines.points, lines.offsets, POINTS)
    surfaces = [(points_of(bone), triangles_of(bone, "test")) for _, bone in blocks_of(blocks)]
    names = [bone for bone, _ in blocks_of(blocks)]
    rings = tuple(
        (names.index(area.bone), via_ring(area.landmarks))
        for area in attachments_of(areas, "test")
        if area.role == "via"
    )
    bones = {number: bone_of(*surface) for number, surface in enumerate(surfaces)}
    ends = bones_at_ends(fibres, points, fixed_to)
    return Strung(phantom, names, points, triangles, fixed_to, fibres, *ends, bones, rings)


def wound_line():
    """Return the middle line of wrapping_cylinder (k, 2), to the middle of its attached face."""
    middle, turn = RADIUS + THICKNESS / 2.0, np.radians(np.linspace(0.0, 95.0, 300))
    return np.vstack([[-STRAIGHT, middle], middle * np.column_stack([np.sin(turn), np.cos(turn)])])


#: Of each phantom: its middle line (y, z) at rest, and how far aside (x) and outward fibres lie of it [mm].
COURSES = {
    # Its course is over the cylinder to the right: outward is to the left.
    "wrapping_cylinder": (wound_line, (-8.0, 0.0, 8.0), (3.0, 0.0, -3.0)),
    "lifting_strap": (lambda: fibre(0.0).points(0.5), (-8.0, 0.0, 8.0), (-3.0, 0.0, 3.0)),
    "strap_over_two_joints": (_middle_line, (-8.0, 0.0, 8.0), (-2.0, 0.0, 2.0)),
    "flexor_over_brim": (lambda: taut(0.0).points(0.5), (-2.0, 0.0, 2.0), (-2.0, 0.0, 2.0)),
    "spindle_over_ball": (lambda: np.array([ORIGIN, INSERTION])[:, 1:], (8.0, 12.0, 16.0), (-4.0, 0.0, 4.0)),
    "tendon_through_ring": (lambda: [(-32.0, 80.0), (-32.0, -60.0)], (-2.0, 0.0, 2.0), (-2.0, 0.0, 2.0)),
    "slivered_tendon": (lambda: [(-18.0, 220.0), (-18.0, -40.0)], (-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0)),
}


def fibres_along(line, across, outward):
    """Return fibres (f, n, 3) beside a line (k, 2) of the y-z plane; outward is right of its course."""
    line = np.asarray(line, dtype=float)
    line = evenly_spread(np.column_stack([np.zeros(len(line)), line]), [0, len(line)], POINTS)[0]
    steps = np.gradient(line, axis=0)
    right = np.cross(steps, [1.0, 0.0, 0.0]) / np.linalg.norm(steps, axis=1, keepdims=True)
    return np.array([line + [x, 0.0, 0.0] + out * right for x in across for out in outward])


@cache
def known_paths(make, *, rings=True, **settings):
    """Return paths in a phantom, by its name, with fibres beside its middle line."""
    made = strung_phantom(make, **settings)
    line, across, outward = COURSES[make]
    fibres = fibres_along(line(), across, outward)
    start, end = bones_at_ends(fibres, made.points, made.fixed_to)
    return made.pulled(fibres=fibres, start_bones=start, end_bones=end, **({} if rings else {"rings": ()}))


@cache
def strung_phantom(make, **settings):
    """Return a phantom, by its name, with paths; settings are tuples or numbers."""
    return strung(getattr(phantoms, make)(**settings))


@cache
def paths_of(make, **settings):
    """Return the paths of such a phantom at rest."""
    return strung_phantom(make, **settings).pulled()


def swept(paths, poses, start=None):
    """Return the states (k) of paths at poses (k, b, 4, 4), one after the other."""
    states, state = [], paths.rest if start is None else start
    for pose in poses:
        state = paths.follow(state, pose)
        states.append(state)
    return states


def levers(state, moving, centre, axis):
    """Return how much each path turns some bones about an axis, at a tension of 1, (f,) [mm].

    moving : numbers of the bones;  centre, axis : (3,), axis of the positive coordinate, unit.
    """
    twists = np.zeros((len(state.transforms), 6))
    twists[moving] = twist_about(centre, axis)
    return state.levers({"q": twists})["q"]


def off_lines(points, lines):
    """Return how far points (f, n, 3) are off polylines (f, m, 3), each of its own, (f, n)."""
    starts, ways = lines[:, None, :-1], np.diff(lines, axis=1)[:, None]
    part = ((points[:, :, None] - starts) * ways).sum(axis=3) / (ways**2).sum(axis=3)
    nearest = starts + part.clip(0.0, 1.0)[..., None] * ways
    return np.linalg.norm(points[:, :, None] - nearest, axis=3).min(axis=2)


def angles(low, high, step=STEP):
    return np.arange(low, high + 0.5 * step, step)


def turned(make, settings, bone, at):
    """Return the poses of a phantom's bones with one turned by angles about the x axis."""
    motion = hinge(bone, centre=(0, 0, 0), axis=AXIS, angles=at)
    return strung_phantom(make, **settings).poses(motion)


def lengths(states):
    """Return the lengths of paths in their states, (k, f) [mm]."""
    return np.array([state.lengths for state in states])
