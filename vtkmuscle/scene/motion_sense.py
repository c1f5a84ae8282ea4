"""Implausible motions: errors or warnings before the run; docs/reference/sense.rst lists the checks."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import combinations, product

import numpy as np

from vtkmuscle.core.mesh.surface import diagonal
from vtkmuscle.core.moment_arms.levers import largest_turns, twists_by
from vtkmuscle.core.motion.coordinates import ANGLES
from vtkmuscle.core.motion.rigid import apply_transform, inverse
from vtkmuscle.core.types import Floats
from vtkmuscle.data.anatomy import JOINTS, stem_of
from vtkmuscle.scene.data import Anatomy, SceneData
from vtkmuscle.scene.faults import Finding

#: Turns of a bone per unit of an angle, either way. A second turn of half the size, as the screw-home of a
#: knee, makes 1.12; this is twice as far off. A unit that is mistaken makes 57 or 0.02.
TURN = 1.25
#: Least turn by a positive direction along its axis in anatomy, as a part of the turn: 120 degrees off.
OPPOSITE = -0.5
#: Angles within half a turn in radians [degrees].
RADIANS = 3.2
#: A jump of a motion is as many times its largest neighbouring step, of three on either side (a sine with
#: eight samples has 2.4), and this part of the bone's size: 2 degrees about an end.
JUMP, STEP = 5.0, 0.02
#: Change of the gap between touching bones, as a part of the smaller bone's size: a femur's head has left its
#: socket by a third of its radius. In eleven scenes of hips, knees, elbows and shoulders it is up to 0.008.
JOINT_GAP = 0.02
#: Distance of bones at which their muscles are certainly torn, in sizes of the smaller bone.
TORN = 2.0
#: Poses and points of a bone for gaps between bones.
_GAP_POSES, _GAP_POINTS = 8, 2000


def motion_findings(scene: SceneData, anatomy: Anatomy) -> Iterator[Finding]:
    """Yield the implausible parts of a scene's motion."""
    yield from _coordinates(scene)
    yield from _steps(scene, anatomy)
    yield from _gaps(scene, anatomy)


def _turns(scene: SceneData, name: str) -> dict[str, Floats]:
    """Return each bone's angular velocity (m, 3) by a coordinate, per unit; 0 for bones at rest."""
    frames, twists = twists_by(scene.motion, name)
    still = np.zeros((len(frames), 3))
    return {bone: twists[bone][:, 3:] if bone in twists else still for bone in scene.bones}


def _coordinates(scene: SceneData) -> Iterator[Finding]:
    """Yield coordinates that contradict the motion of the bones: in size, or in direction."""
    angles = {name: q for name, q in scene.motion.coordinates.items() if q.unit in ANGLES and q.changes}
    widest = np.degrees(max((float(np.ptp(q.natural)) for q in angles.values()), default=np.inf))
    if widest < RADIANS and all(q.twists for q in angles.values()):
        problem = f"the angles change by no more than {widest:.3g} degrees"
        yield Finding("motion", problem, "write angles in degrees, not radians")
    for name, q in angles.items():
        key, turns = f"motion.coordinates.{name}", _turns(scene, name)
        pairs = [np.linalg.norm(turns[a] - turns[b], axis=1) for a, b in combinations(turns, 2)]
        sizes = [turn for turn in pairs if len(turn)]
        if q.twists is None and sizes:  # else the joint itself turns the bones
            best = min(sizes, key=lambda turn: float(np.abs(np.log(turn + 1e-9)).mean()))
            low, high = np.percentile(best, (25, 75))
            if low < 1.0 / TURN or high > TURN:
                problem = f"the bones turn by {np.median(best):.3g} degrees per degree of the coordinate"
                remedy = 'check the column, and its unit: { unit = "rad" } for radians'
                yield Finding(key, problem, remedy)
                continue
        if sizes:
            yield from _direction(key, name, q.positive, turns, scene)


def _direction(
    key: str, name: str, positive: str, turns: dict[str, Floats], scene: SceneData
) -> Iterator[Finding]:
    """Yield a coordinate that turns a bone against its name, as from a standing pose in the frame."""
    words = set(re.findall("[a-z]+", f"{name} {positive}".casefold().replace("_", " ")))
    for kind in JOINTS:
        axis = next((np.array(kind.axes[one]) for one in kind.axes if "flexion" in one), None)
        ends = [
            [bone for bone in scene.bones if set(stem_of(bone).split("_")) & set(words_of)]
            for words_of in (kind.children, kind.parents)
        ]
        if axis is None or "flexion" not in words or not all(ends):
            continue
        (child, *_), (parent, *_) = ends
        if scene.frame == "RAS":
            axis = axis * [-1.0, -1.0, 1.0]
        turn = (turns[child] - turns[parent]).mean(axis=0)
        if turn @ axis < OPPOSITE * np.linalg.norm(turn) < 0.0:
            problem = f"its sign is not of flexion: by the coordinate {child!r} extends in {scene.frame}"
            yield Finding(key, problem, "exchange the sign; or correct the frame, or the coordinate's name")
        return


def _steps(scene: SceneData, anatomy: Anatomy) -> Iterator[Finding]:
    """Yield the largest jump of the motion; steps are of all bones, as bones on a grid move in turn."""
    steps = np.zeros(len(scene.motion.times) - 1)
    for bone in scene.motion.transforms.keys() & anatomy.bones.keys():
        table, points = scene.motion.transforms[bone], anatomy.bones[bone].points
        corners = np.array(list(product(*zip(points.min(axis=0), points.max(axis=0), strict=True))))
        moved = np.einsum("fij,kj->fki", table[:, :3, :3], corners) + table[:, None, :3, 3]
        step = np.linalg.norm(np.diff(moved, axis=0), axis=2).mean(axis=1) / diagonal(points)
        steps = np.maximum(steps, step)
    if len(steps) < 3:
        return
    near = [np.delete(steps[max(0, i - 3) : i + 4], min(i, 3)).max() for i in range(len(steps))]
    odd = np.where(steps > STEP, steps / np.maximum(near, STEP / JUMP), 0.0)
    worst = int(odd.argmax())
    alone = (steps > 0.5 * steps[worst]).sum() == 1  # the slow coordinate of a grid steps again
    if odd[worst] > JUMP and alone:
        angle = np.degrees(largest_turns(scene.motion)[worst])
        problem = f"the bones jump from frame {worst} to frame {worst + 1}, by {angle:.3g} degrees: "
        problem += f"the step is {odd[worst]:.2g} times as large as the steps beside it"
        yield Finding("motion", problem, "add the missing frames, or correct the transforms")


def _gaps(scene: SceneData, anatomy: Anatomy) -> Iterator[Finding]:
    """Yield bones that leave the bones they touch at rest, run into bones, or fly apart."""
    chosen = np.unique(np.linspace(0, len(scene.motion.times) - 1, _GAP_POSES).astype(np.int64))
    sizes = {name: diagonal(bone.points) for name, bone in anatomy.bones.items()}
    bodies: dict[bytes, list[str]] = {}
    for bone in anatomy.bones:
        bodies.setdefault(scene.motion.transforms.get(bone, np.eye(4)).tobytes(), []).append(bone)
    for body, others in combinations(bodies.values(), 2):
        tables = [scene.motion.transforms.get(names[0]) for names in (others, body)]
        pairs = list(product(body, others))
        gaps = []
        for pose in (None, *chosen):
            now, fixed = (np.eye(4) if pose is None or table is None else table[pose] for table in tables)
            gaps.append([_gap(anatomy, *pair, inverse(fixed) @ now) for pair in pairs])
        closest = np.min(gaps, axis=1)
        size = min(max(sizes[bone] for bone in names) for names in (body, others))
        near = JOINT_GAP * size
        # Bones between the two, as a femur between pelvis and tibia, let both go apart by their own sizes.
        reach = size + sum(sizes[bone] for bone in sizes.keys() - {*body, *others})
        deeper, apart = np.maximum(0.0, -closest), np.maximum(0.0, closest)
        for limit, way, gap in (
            (near, "deeper in each other", deeper),
            (near if apart[0] < near else reach, "farther apart", apart),
        ):
            worst, change = int(gap.argmax()), float(gap.max() - gap[0])
            if change > limit:
                bone, other = pairs[int(np.argmin(gaps[0 if gap is apart else worst]))]
                problem = f"in frame {chosen[worst - 1]} the bones {bone!r} and {other!r} are "
                problem += f"{change * scene.millimetres:.3g} mm {way} than at rest"
                remedy = "check the joint's centre and axes, and unit and order of the transforms"
                yield Finding("motion", problem, remedy, change > TORN * size)


def _gap(anatomy: Anatomy, bone: str, other: str, moved: Floats) -> float:
    """Return the gap between a bone and another bone that is moved, negative inside."""
    points, solids = anatomy.bones[other].points, anatomy.bones[bone].solids
    placed = apply_transform(moved, points[:: 1 + len(points) // _GAP_POINTS])
    (low, high), ends = solids.box, (placed.min(axis=0), placed.max(axis=0))
    far = float(np.linalg.norm(np.maximum(0.0, np.maximum(low - ends[1], ends[0] - high))))
    if far > 0.1 * diagonal(points):
        return far  # of the boxes: closer bones are measured
    within = placed[solids.inside(placed)]  # the sign of a distance fails at ragged holes
    return float(-solids.depth(within).max() if len(within) else np.abs(solids.distances(placed)).min())
