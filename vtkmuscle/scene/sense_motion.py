"""Implausible motions; see :mod:`vtkmuscle.scene.sense`."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from vtkmuscle.core.motion.rigid import apply_transform, inverse
from vtkmuscle.core.types import Floats
from vtkmuscle.scene.data import Anatomy, SceneData

#: Rotation of a bone from one frame to the next that is a jump rather than a step [degrees].
JUMP = 60.0
#: Displacement of a bone from one frame to the next, in its own diagonals: probably, and certainly a mistake.
FAR, SURE_FAR = 0.5, 20.0
#: Displacement of a bone's centre of rotation from one frame to the next that is a jump: more than this [mm],
#: and than so many times the median. A joint's moves by 1 to 2 mm, evenly.
SLIP, UNEVEN = 10.0, 10.0
#: Change of a pose's numbers, [1] and [the scene's unit], by which no bone moves: rounding.
STILL = 1e-9
#: Fewest steps in which one or two can stand out.
FEWEST = 6
#: Distance of a muscle's areas, relative to rest or to half its length: probably, and certainly torn.
TORN, SURE_TORN = 2.0, 5.0


class Finding(NamedTuple):
    """Something implausible in a scene; ``certain`` where no useful result is possible."""

    key: str
    problem: str
    remedy: str
    certain: bool = False


def motion_findings(scene: SceneData, anatomy: Anatomy) -> Iterator[Finding]:
    """Give a finding for each implausible thing in a motion."""
    for bone in scene.motion.transforms:
        yield from _jumps(scene, bone, anatomy.bones[bone].points)
    for name, muscle in scene.muscles.items():
        middles = [(area.bone, np.asarray(area.landmarks).mean(axis=0)) for area in muscle.attachments]
        if len({bone for bone, _ in middles}) < 2:
            continue
        length = float(np.linalg.norm(np.ptp(anatomy.muscles[name].points, axis=0)))
        spans = np.array([_span(middles, scene.motion.at(float(time))) for time in scene.motion.times])
        longest = int(np.argmax(spans))
        ratio = spans[longest] / max(_span(middles, {}), 0.5 * length)
        if ratio > TORN:
            problem = (
                f"its areas come {spans[longest]:.3g} {scene.units} apart in frame {longest}, {ratio:.3g} "
                "times as far as at rest: a muscle would tear"
            )
            remedy = "check the motion, and that its transforms are from rest to the pose"
            yield Finding(f"muscles.{name}.attachments", problem, remedy, ratio > SURE_TORN)


def _jumps(scene: SceneData, bone: str, points: Floats) -> Iterator[Finding]:
    """Give the largest jump of a bone, from rest to the first frame or from a frame to the next."""
    transforms = scene.motion.transforms[bone]
    corners = _corners(points)
    size = float(np.linalg.norm(corners[-1] - corners[0]))
    poses = np.concatenate([np.eye(4)[None], transforms])
    places = np.array([apply_transform(pose, corners) for pose in poses])
    with np.errstate(over="ignore"):
        ways = np.linalg.norm(np.diff(places, axis=0), axis=2).max(axis=1)
    turns = np.array([_turn(one, other) for one, other in pairwise(poses)])
    worst, most = int(np.argmax(ways)), int(np.argmax(turns))
    far = f"{bone!r} moves {ways[worst]:.3g} {scene.units} {_where(worst)}, and is {size:.3g} long"
    if ways[worst] > SURE_FAR * size:
        yield Finding("motion", far, "check the unit of its translations", certain=True)
    elif turns[most] > JUMP:
        problem = f"{bone!r} turns by {turns[most]:.3g} degrees {_where(most)}"
        yield Finding("motion", problem, "give more frames: muscles follow in small steps")
    elif ways[worst] > FAR * size:
        yield Finding("motion", far, "give more frames, or check the unit of its translations")
    elif len(scene.motion.coordinates) < 2:  # several joints have no one centre
        slips = _slips(transforms, corners.mean(axis=0))
        if len(slips) < FEWEST or (slips > 0.5 * slips.max()).sum() > 2:  # more than there and back
            return
        if slips.max() > max(SLIP / scene.millimetres, UNEVEN * np.median(slips)):
            step = int(np.argmax(slips))
            problem = f"{bone!r} jumps by {slips[step]:.3g} {scene.units} {_where(step + 1)}; the median "
            problem += f"displacement of its centre of rotation in a step is {np.median(slips):.2g}"
            yield Finding("motion", problem, "correct the rows about there")


def _slips(transforms: Floats, middle: Floats) -> Floats:
    """Return the displacement in each step of the centre of rotation of most steps."""
    steps = np.diff(transforms, axis=0)
    turns, ways = steps[:, :3, :3], steps[:, :3, 3] + steps[:, :3, :3] @ middle
    kept = moved = np.abs(steps).max(axis=(1, 2)) > STILL
    if not moved.any():
        return np.zeros(len(steps))
    for _ in range(2):  # of all steps in which it moves, then of the half with the least displacements
        centre = np.linalg.lstsq(turns[kept].reshape(-1, 3), -ways[kept].ravel(), rcond=1e-6)[0]
        slips = np.linalg.norm(turns @ centre + ways, axis=1)
        kept = moved & (slips <= np.median(slips[moved]))
    return np.asarray(slips)


def _corners(points: Floats) -> Floats:
    """Return the corners (8, 3) of a bounding box, the lowest first and the highest last."""
    return np.array(list(product(*zip(points.min(axis=0), points.max(axis=0), strict=True))))


def _turn(one: Floats, other: Floats) -> float:
    """Return the angle between two poses [degrees]."""
    cosine = 0.5 * (np.trace((other @ inverse(one))[:3, :3]) - 1.0)
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def _where(step: int) -> str:
    return "from rest to the first frame" if step == 0 else f"from frame {step - 1} to frame {step}"


def _span(middles: list[tuple[str, Floats]], frame: dict[str, Floats]) -> float:
    """Return the largest distance between the middles of two areas in a pose."""
    places = [apply_transform(frame.get(bone, np.eye(4)), middle[None])[0] for bone, middle in middles]
    return max(float(np.linalg.norm(a - b)) for a in places for b in places)
