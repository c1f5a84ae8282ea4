"""Implausible scenes: errors or warnings before the run; docs/reference/sense.rst lists the checks."""

import re
import warnings
from collections.abc import Iterator, Mapping
from itertools import combinations, permutations, product
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from vtkmuscle.core.attachments.patches import ring_sides, short_ring
from vtkmuscle.core.bones.bone import Bone, bone_of
from vtkmuscle.core.bones.joint_fits import head_in
from vtkmuscle.core.mesh.sampling import samples_inside
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.mesh.surface import box_of, diagonal, longest_side, mean_thickness, signed_volume
from vtkmuscle.core.moment_arms.levers import largest_turns, twists_by
from vtkmuscle.core.motion.coordinates import ANGLES, MILLIMETRES
from vtkmuscle.core.motion.rigid import apply_transform, inverse, inverses
from vtkmuscle.core.types import Floats
from vtkmuscle.data import toml_table
from vtkmuscle.data.anatomy import JOINTS, has_word
from vtkmuscle.data.arrays import points_of
from vtkmuscle.data.attachments import ROLES, AttachmentArea
from vtkmuscle.scene.data import Anatomy, Finding, Muscle, RestSurface, SceneData, SceneError

#: Checks by name: limits, and words.
CHECKS = toml_table("vtkmuscle.scene", "sense.toml")
#: Limits that are lengths hold for muscles of this size, the cube root of the volume [mm], and are in
#: proportion for other muscles, so that a mouse is judged as a man is. Muscles of a hip and a knee have 23
#: (quadratus femoris) to 91 (gluteus maximus).
FULL_SIZE = 50.0


def _finding(check: str, key: str, *, certain: bool = False, **values: Any) -> Finding:
    """Return a finding in the words of a check."""
    problem, remedy = (CHECKS[check][part].format(**values) for part in ("says", "do"))
    return Finding(key, problem, remedy, certain)


def check_sense(scene: SceneData) -> list[SceneError]:
    """Warn about probable mistakes in a scene, and return them. SceneError for a certain mistake."""
    odd, mistakes = [], findings(scene, Anatomy.of(scene))
    for key, problem, remedy, certain in sorted(mistakes, key=lambda finding: not finding.certain):
        error = SceneError(problem, key, remedy, scene.files.get(key, scene.files.get("")))
        if certain:
            raise error
        odd.append(error)
        warnings.warn(str(error), stacklevel=5)  # at the call that runs the scene
    return odd


def findings(scene: SceneData, anatomy: Anatomy) -> Iterator[Finding]:
    """Yield the implausible parts of a scene."""
    sizes = list(_sizes(scene.units, anatomy))
    yield from sizes
    if any(finding.certain for finding in sizes):
        return  # all other measures would be meaningless
    for name in (name for name in anatomy.bones if name not in anatomy.solid_bones):
        yield _finding("no_volume", f"bones.{name}.surface")
    for name, muscle in scene.muscles.items():
        surface = anatomy.muscles[name]
        for number, area in enumerate(muscle.attachments):
            key = f"muscles.{name}.attachments[{number}].landmarks"
            odd = disorder(key, area, longest_side(surface.points), scene.units)
            yield from (each for each in odd if area.closed or each.certain)  # loose points are allowed
        yield from _on_bones(scene.millimetres, name, muscle, anatomy)
        yield from _in_bones(scene.millimetres, name, anatomy)
    if scene.muscle_contact != "off":
        yield from _twice("muscle", {name: bone_of(*surface) for name, surface in anatomy.muscles.items()})
    yield from _twice("bone", anatomy.solid_bones)
    yield from _guessed(scene)
    yield from _coordinates(scene)
    yield from _steps(scene, anatomy)
    yield from _gaps(scene, anatomy)
    yield from _heads(scene, anatomy)


def _sizes(units: str, anatomy: Anatomy) -> Iterator[Finding]:
    clouds = {f"bones.{name}.surface": bone.points for name, bone in anatomy.bones.items()}
    clouds |= {f"muscles.{name}.surface": muscle.points for name, muscle in anatomy.muscles.items()}
    longest = max(longest_side(points) for points in clouds.values())
    offset = max(float(np.abs(points).max()) for points in clouds.values())
    if offset > CHECKS["far_from_origin"]["sizes"] * longest > 0.0:
        yield _finding("far_from_origin", "", certain=True, offset=offset, units=units)
    volumes = {name: abs(signed_volume(*surface)) for name, surface in anatomy.muscles.items()}
    largest, limits = max(volumes, key=volumes.__getitem__), CHECKS["unit"]
    fitting = [
        unit
        for unit in ("mm", "m", "cm")
        if limits["shortest"] <= longest * MILLIMETRES[unit] <= limits["longest"]
        and volumes[largest] * MILLIMETRES[unit] ** 3 <= limits["volume"]
    ]
    if units in fitting:
        yield from other_units(clouds)
        return
    size, volume = longest * MILLIMETRES[units], volumes[largest] * MILLIMETRES[units] ** 3
    litres = limits["says_volume"].format(muscle=largest, litres=volume / 1e6)
    problem = limits["says"].format(longest=size, volume=litres if volume > limits["volume"] else "")
    remedy = limits["do_unit"].format(unit=fitting[0]) if fitting else limits["do"]
    yield Finding("units", problem, remedy, size > limits["certain"])


def other_units(clouds: Mapping[str, Floats]) -> Iterator[Finding]:
    """Yield surfaces too small beside the largest one."""
    sizes = {key: longest_side(points) for key, points in clouds.items()}
    for key, size in sizes.items():
        if size * CHECKS["other_unit"]["ratio"] < (longest := max(sizes.values())):
            yield _finding("other_unit", key, certain=True, size=size, longest=longest)


def disorder(key: str, area: AttachmentArea, size: float, units: str) -> Iterator[Finding]:
    """Yield landmarks that coincide, in a scene of a size, or are out of order.

    An open curve lacks a side of a ring, and is compared with a short ring without the longest side.
    """
    limits, landmarks = CHECKS["ring"], np.asarray(area.landmarks, dtype=np.float64)
    count = len(landmarks)
    if count > 1 and diagonal(landmarks) <= 1e-9 * size:
        yield _finding("coincide", key, certain=True, count=count)
    elif count > 3 and not area.estimated:
        landmarks = landmarks[:: -(-count // limits["landmarks"])]
        own, short = ring_sides(landmarks), ring_sides(landmarks[short_ring(landmarks)])
        if not area.closed:
            own, short = own[:-1], np.sort(short)[:-1]
        if (length := own.sum()) > limits["ratio"] * short.sum():
            words = {"line": "ring" if area.closed else "curve", "ratio": length / short.sum()}
            certain = area.closed and words["ratio"] > limits["certain"]
            yield _finding("ring", key, certain=certain, length=length, units=units, **words)


def _guessed(scene: SceneData) -> Iterator[Finding]:
    """Yield guesses of attachments, joints and the unit that are not sure."""
    sure = CHECKS["estimate"]["confidence"]
    for name, muscle in scene.muscles.items():
        for number, area in enumerate(muscle.attachments):
            if area.confidence is not None and area.confidence < sure:
                key, confidence = f"muscles.{name}.attachments[{number}]", area.confidence
                yield _finding("estimate", key, role=area.role, bone=area.bone, confidence=confidence)
    for key, confidence in scene.guessed.items():
        if confidence < sure:
            yield _finding("guess", f"guessed.{key}", confidence=confidence)


def _twice(kind: str, bodies: Mapping[str, Bone]) -> Iterator[Finding]:
    """Yield muscles or bones that lie in one another."""
    for pair in combinations(bodies.items(), 2):
        for (name, body), (other, around) in (pair, pair[::-1]):
            if (np.maximum(body.box[0], around.box[0]) >= np.minimum(body.box[1], around.box[1])).any():
                break
            samples = samples_inside(body.solids.inside, body.points, CHECKS["twice"]["samples"])
            share = np.count_nonzero(around.solids.inside(samples)) / max(len(samples), 1)
            if share > CHECKS["twice"]["share"]:
                yield _finding("twice", f"{kind}s.{name}.surface", share=share, other=other, kind=kind)
                break


def _scale(muscle: RestSurface, millimetres: float) -> float:
    return millimetres * float(np.cbrt(abs(signed_volume(*muscle)))) / FULL_SIZE


def _in_bones(millimetres: float, name: str, anatomy: Anatomy) -> Iterator[Finding]:
    """Yield bones deep in a muscle at rest, or around a muscle."""
    muscle, limits = anatomy.muscles[name], CHECKS["in_bone"]
    deepest = limits["depth"] * _scale(muscle, millimetres)
    for bone, surface in anatomy.bones.items():
        few = surface.points[:: 1 + len(surface.points) // limits["points"]]
        for inner, outer, points, solids, spread in (
            ("the muscle", f"the bone {bone!r}", muscle.points, surface.solids, 0.0),
            (f"the bone {bone!r}", "the muscle", few, solids_of(*muscle), deepest),
        ):
            within = np.flatnonzero(solids.inside(points))  # much faster than the depth of every point
            depths = np.zeros(len(points))
            depths[within] = millimetres * solids.depth(points[within])
            deep = points[depths > deepest]
            if len(deep) and millimetres * diagonal(deep) >= spread:
                where, share = tuple(points[np.argmax(depths)]), (depths > 0.0).mean()
                words: dict[str, Any] = {"inner": inner, "outer": outer, "position": where, "share": share}
                yield _finding("in_bone", f"muscles.{name}.surface", depth=depths.max(), **words)
                break


def _on_bones(millimetres: float, name: str, muscle: Muscle, anatomy: Anatomy) -> Iterator[Finding]:
    """Yield landmarks away from the bone named for them."""
    key = f"muscles.{name}.attachments"
    surface = anatomy.muscles[name]
    length, scale = diagonal(surface.points) * millimetres, _scale(surface, millimetres)
    thickness, solids = mean_thickness(*surface) * millimetres, solids_of(*surface)
    areas = {number: area for number, area in enumerate(muscle.attachments) if area.role in ROLES}
    away, medians, nearest, limits = {}, {}, {}, CHECKS["other_bone"]
    for number, area in areas.items():
        gaps_to = {bone: shape.solids.distances(area.landmarks) for bone, shape in anatomy.bones.items()}
        away[number] = {bone: millimetres * np.abs(gaps) for bone, gaps in gaps_to.items()}
        far = medians[number] = {bone: float(np.median(gaps)) for bone, gaps in away[number].items()}
        other = min(far, key=far.__getitem__)
        if far[area.bone] > max(limits["distance"] * scale, limits["nearer"] * far[other]):
            nearest[number] = other
    exchanged = {(areas[number].bone, bone) for number, bone in nearest.items()}
    if len(areas) == len(nearest) > 1 and exchanged == {(b, a) for a, b in exchanged}:
        yield _finding("exchanged", key, certain=True)
        return
    for number, area in areas.items():
        where, own = f"{key}[{number}].landmarks", medians[number][area.bone]
        lost = float(away[number][area.bone].min()) > CHECKS["far"]["lengths"] * length
        if number in nearest and not lost:
            gap, other = medians[number][nearest[number]], nearest[number]
            yield _finding("other_bone", where, own=own, bone=area.bone, other=other, other_gap=gap)
        elif own > CHECKS["far"]["thicknesses"] * thickness:
            yield _finding("far", where, certain=lost, own=own, bone=area.bone)
        off = millimetres * float(np.median(np.abs(solids.distances(area.landmarks))))
        if off > CHECKS["off"]["thicknesses"] * thickness:
            yield _finding("off", where, off=off)
    bones = {area.bone for area in areas.values()}
    if len(areas) > 1 and len(bones) == 1:
        yield _finding("one_bone", key, bone=bones.pop())


def _moves(scene: SceneData, name: str) -> dict[str, Floats]:
    """Return each bone's velocity by a coordinate, (m, 3). Angular by an angle, else of its middle."""
    frames, twists = twists_by(scene.motion, name)
    angle, still, moves = scene.motion.coordinates[name].unit in ANGLES, np.zeros((len(frames), 6)), {}
    for bone, surface in scene.bones.items():
        twist = twists.get(bone, still)
        shift = twist[:, :3] + np.cross(twist[:, 3:], points_of(surface).mean(axis=0))
        moves[bone] = twist[:, 3:] if angle else scene.millimetres * shift
    return moves


def _coordinates(scene: SceneData) -> Iterator[Finding]:
    """Yield coordinates that contradict the motion of the bones: in size, or in direction."""
    changing = {name: q for name, q in scene.motion.coordinates.items() if q.changes}
    angles = {name: q for name, q in changing.items() if q.unit in ANGLES}
    widest = np.degrees(max((float(np.ptp(q.natural)) for q in angles.values()), default=np.inf))
    if widest < CHECKS["radians"]["degrees"] and all(q.twists for q in angles.values()):
        yield _finding("radians", "motion", widest=widest)
    for name, q in changing.items():
        key, check = f"motion.coordinates.{name}", "turns" if name in angles else "shifts"
        moves, ratio = _moves(scene, name), CHECKS[check]["ratio"]
        pairs = [np.linalg.norm(moves[a] - moves[b], axis=1) for a, b in combinations(moves, 2)]
        sizes = [move for move in pairs if len(move)]
        if q.twists is None and sizes:  # else the joint itself moves the bones
            best = min(sizes, key=lambda move: float(np.abs(np.log(move + 1e-9)).mean()))
            low, high = np.percentile(best, (25, 75))
            if low < 1.0 / ratio or high > ratio:
                yield _finding(check, key, move=np.median(best))
                continue
        if sizes and name in angles:
            yield from _direction(key, name, q.positive, moves, scene)


def _direction(
    key: str, name: str, positive: str, turns: dict[str, Floats], scene: SceneData
) -> Iterator[Finding]:
    """Yield a coordinate that turns a bone against its name, as from a standing pose in the frame."""
    words = set(re.findall("[a-z]+", f"{name} {positive}".casefold().replace("_", " ")))
    for kind in JOINTS:
        axis = next((np.array(kind.axes[name]) for name in kind.axes if "flexion" in name), None)
        ends = [[bone for bone in scene.bones if has_word(bone, of)] for of in (kind.children, kind.parents)]
        if axis is None or "flexion" not in words or not all(ends):
            continue
        (child, *_), (parent, *_) = ends
        if scene.frame == "RAS":
            axis = axis * [-1.0, -1.0, 1.0]
        turn = (turns[child] - turns[parent]).mean(axis=0)
        if turn @ axis < CHECKS["sign"]["part"] * np.linalg.norm(turn) < 0.0:
            yield _finding("sign", key, bone=child, frame=scene.frame)
        return


def _steps(scene: SceneData, anatomy: Anatomy) -> Iterator[Finding]:
    """Yield the largest jump of the motion, among steps of all bones."""
    steps, limits = np.zeros(len(scene.motion.times) - 1), CHECKS["jump"]
    for bone in scene.motion.transforms.keys() & anatomy.bones.keys():
        table, points = scene.motion.transforms[bone], anatomy.bones[bone].points
        corners = np.array(list(product(*zip(*box_of(points), strict=True))))
        moved = np.einsum("fij,kj->fki", table[:, :3, :3], corners) + table[:, None, :3, 3]
        step = np.linalg.norm(np.diff(moved, axis=0), axis=2).mean(axis=1) / diagonal(points)
        steps = np.maximum(steps, step)
    if len(steps) < 3:
        return
    near = [np.delete(steps[max(0, i - 3) : i + 4], min(i, 3)).max() for i in range(len(steps))]
    odd = np.where(steps > limits["step"], steps / np.maximum(near, limits["step"] / limits["times"]), 0.0)
    worst = int(odd.argmax())
    alone = (steps > 0.5 * steps[worst]).sum() == 1  # the slow coordinate of a grid steps again
    if odd[worst] > limits["times"] and alone:
        angle = np.degrees(largest_turns(scene.motion)[worst])
        yield _finding("jump", "motion", angle=angle, times=odd[worst], frame=worst, next_frame=worst + 1)


def _gaps(scene: SceneData, anatomy: Anatomy) -> Iterator[Finding]:
    """Yield bones that leave the bones they touch at rest, run into bones, or fly apart."""
    limits = CHECKS["gap"]
    chosen = np.unique(np.linspace(0, len(scene.motion.times) - 1, limits["poses"]).astype(np.int64))
    sizes = {name: diagonal(bone.points) for name, bone in anatomy.bones.items()}
    bodies: dict[bytes, list[str]] = {}
    for bone in anatomy.bones:
        bodies.setdefault(scene.motion.transforms.get(bone, np.eye(4)).tobytes(), []).append(bone)
    for body, opposite in combinations(bodies.values(), 2):
        tables = [scene.motion.transforms.get(names[0]) for names in (opposite, body)]
        pairs = list(product(body, opposite))
        gaps = []
        for pose in (None, *chosen):
            now, fixed = (np.eye(4) if pose is None or table is None else table[pose] for table in tables)
            gaps.append([_gap(anatomy, *pair, inverse(fixed) @ now) for pair in pairs])
        closest = np.min(gaps, axis=1)
        size = min(max(sizes[bone] for bone in names) for names in (body, opposite))
        near = limits["part"] * size
        # Bones between the two, as a femur between pelvis and tibia, let both go apart by their own sizes.
        reach = size + sum(sizes[bone] for bone in sizes.keys() - {*body, *opposite})
        deeper, apart = np.maximum(0.0, -closest), np.maximum(0.0, closest)
        for limit, how, gap in (
            (near, "deeper in each other", deeper),
            (near if apart[0] < near else reach, "farther apart", apart),
        ):
            worst, change = int(gap.argmax()), float(gap.max() - gap[0])
            if change > limit:
                bone, other = pairs[int(np.argmin(gaps[0 if gap is apart else worst]))]
                words: dict[str, Any] = {"bone": bone, "other": other, "how": how, "frame": chosen[worst - 1]}
                certain, change = change > limits["torn"] * size, change * scene.millimetres
                yield _finding("gap", "motion", certain=certain, change=change, **words)


def _heads(scene: SceneData, anatomy: Anatomy) -> Iterator[Finding]:
    """Yield bones that do not turn about the centre of their head."""
    still, limits = np.tile(np.eye(4), (len(scene.motion.times), 1, 1)), CHECKS["head"]
    for bone, socket in permutations(anatomy.solid_bones, 2):
        own, theirs = (scene.motion.transforms.get(name, still) for name in (bone, socket))
        moves = inverses(theirs) @ own
        turns = Rotation.from_matrix(moves[:, :3, :3]).magnitude()
        move, turn = moves[turns.argmax()], float(turns.max())
        if np.degrees(turn) < limits["turn"]:
            continue
        head = head_in(anatomy.solid_bones[bone], anatomy.solid_bones[socket])
        if head is None or head.confidence < CHECKS["estimate"]["confidence"]:
            continue
        off = np.linalg.norm(apply_transform(move, head.centre) - head.centre) / (2.0 * np.sin(turn / 2.0))
        if off > limits["part"] * head.radius:
            sizes = {"off": off * scene.millimetres, "radius": head.radius * scene.millimetres}
            yield _finding("head", "motion", bone=bone, **sizes)


def _gap(anatomy: Anatomy, bone: str, other: str, moved: Floats) -> float:
    """Return the gap between a bone and another bone that is moved, negative inside."""
    points, solids = anatomy.bones[other].points, anatomy.bones[bone].solids
    placed = apply_transform(moved, points[:: 1 + len(points) // CHECKS["gap"]["points"]])
    (low, high), ends = solids.box, box_of(placed)
    far = float(np.linalg.norm(np.maximum(0.0, np.maximum(low - ends[1], ends[0] - high))))
    if far > 0.1 * diagonal(points):
        return far  # of the boxes: closer bones are measured
    within = placed[solids.inside(placed)]  # the sign of a distance fails at ragged holes
    return float(-solids.depth(within).max() if len(within) else np.abs(solids.distances(placed)).min())
