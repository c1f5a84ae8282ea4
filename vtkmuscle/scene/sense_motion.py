"""Implausible motions; see :mod:`vtkmuscle.scene.sense`."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from vtkmuscle.core.motion.rigid import apply_transform, inverse
from vtkmuscle.core.types import Floats
from vtkmuscle.scene.data import Anatomy, SceneData

#: Turn of a bone from one frame to the next that is a jump rather than a step [degrees].
JUMP = 60.0
#: Way of a bone from one frame to the next, in its own diagonals: a jump; surely no motion of a joint.
FAR, SURE_FAR = 0.5, 20.0
#: Way of a bone's centre of rotation from one frame to the next: a jump where it is more than this [mm], and
#: than so many times the median. A joint's moves by 1 to 2 mm, evenly.
SLIP, UNEVEN = 10.0, 10.0
#: Change of a pose's numbers, [1] and [the scene's unit], by which no bone moves: rounding.
STILL = 1e-9
#: Steps of which one or two can be said to be odd.
FEWEST = 6
#: Distance of a muscle's areas, in units of that at rest, or of its length: it is torn; surely so.
TORN, SURE_TORN = 2.0, 5.0


def motion_findings(scene: SceneData, anatomy: Anatomy) -> Iterator[tuple[str, str, str, bool]]:
    """Give a finding for each implausible thing in a motion."""
    key = "motion"
    motion = scene.motion
    for bone, transforms in motion.transforms.items():
        corners = _corners(anatomy.bones[bone].points)
        size = float(np.linalg.norm(corners[-1] - corners[0]))
        poses = np.concatenate([np.eye(4)[None], transforms])
        # From rest to the first frame, and from each to the next.
        places = np.array([apply_transform(pose, corners) for pose in poses])
        with np.errstate(over="ignore"):
            ways = np.linalg.norm(np.diff(places, axis=0), axis=2).max(axis=1)
        worst = int(np.argmax(ways))
        turns = np.array([_turn(one, other) for one, other in pairwise(poses)])
        most = int(np.argmax(turns))
        if ways[worst] > SURE_FAR * size:
            problem = (
                f"{bone!r} moves {ways[worst]:.3g} {scene.units} {_where(worst)}, and is {size:.3g} long"
            )
            yield key, problem, "check the unit of its translations", True
        elif turns[most] > JUMP:
            problem = f"{bone!r} turns by {turns[most]:.3g} degrees {_where(most)}"
            yield key, problem, "give more frames: muscles follow in small steps", False
        elif ways[worst] > FAR * size:
            problem = (
                f"{bone!r} moves {ways[worst]:.3g} {scene.units} {_where(worst)}, and is {size:.3g} long"
            )
            yield key, problem, "give more frames, or check the unit of its translations", False
        elif len(motion.coordinates) < 2:  # of several joints there is no one centre
            slips = _slips(transforms, corners.mean(axis=0))
            if len(slips) < FEWEST or (slips > 0.5 * slips.max()).sum() > 2:  # there, or there and back
                continue
            if slips.max() > max(SLIP / scene.millimetres, UNEVEN * np.median(slips)):
                step = int(np.argmax(slips))
                problem = (
                    f"{bone!r} jumps by {slips[step]:.3g} {scene.units} {_where(step + 1)}, where in the "
                )
                problem += f"middle of all steps its centre of rotation moves {np.median(slips):.2g}"
                yield key, problem, "correct the rows about there", False
    for name, muscle in scene.muscles.items():
        middles = [(area.bone, np.asarray(area.landmarks).mean(axis=0)) for area in muscle.attachments]
        if len({bone for bone, _ in middles}) < 2:
            continue
        length = float(np.linalg.norm(np.ptp(anatomy.muscles[name].points, axis=0)))
        frames = [motion.at(float(time)) for time in motion.times]
        spans = np.array([_span(middles, frame) for frame in frames])
        longest = int(np.argmax(spans))
        ratio = spans[longest] / max(_span(middles, {}), 0.5 * length)
        if ratio > TORN:
            problem = (
                f"its areas come {spans[longest]:.3g} {scene.units} apart in frame {longest}, {ratio:.3g} "
                "times as far as at rest: a muscle would tear"
            )
            remedy = "check the motion, and that its transforms are from rest to the pose"
            yield f"muscles.{name}.attachments", problem, remedy, ratio > SURE_TORN


def _slips(transforms: Floats, middle: Floats) -> Floats:
    """Return how far a bone's centre of rotation goes in each step; it is that of most steps."""
    steps = np.diff(transforms, axis=0)
    turns, ways = steps[:, :3, :3], steps[:, :3, 3] + steps[:, :3, :3] @ middle
    kept = moved = np.abs(steps).max(axis=(1, 2)) > STILL
    if not moved.any():
        return np.zeros(len(steps))
    for _ in range(2):  # of all in which it moves, then without the half in which it goes farthest
        centre = np.linalg.lstsq(turns[kept].reshape(-1, 3), -ways[kept].ravel(), rcond=1e-6)[0]
        slips = np.linalg.norm(turns @ centre + ways, axis=1)
        kept = moved & (slips <= np.median(slips[moved]))
    return np.asarray(slips)


def _corners(points: Floats) -> Floats:
    low, high = points.min(axis=0), points.max(axis=0)
    return np.array(
        [[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i, j, k in np.ndindex(2, 2, 2)]
    )


def _turn(one: Floats, other: Floats) -> float:
    """Return the angle between two poses [degrees]."""
    cosine = 0.5 * (np.trace((other @ inverse(one))[:3, :3]) - 1.0)
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def _where(step: int) -> str:
    return "from rest to the first frame" if step == 0 else f"from frame {step - 1} to frame {step}"


def _span(middles: list[tuple[str, Floats]], frame: dict[str, Floats]) -> float:
    """Return the largest distance of two areas' middles in a pose."""
    places = [apply_transform(frame.get(bone, np.eye(4)), middle[None])[0] for bone, middle in middles]
    return max(float(np.linalg.norm(a - b)) for a in places for b in places)
