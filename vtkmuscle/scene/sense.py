"""Implausible scenes: errors or warnings before the run; docs/reference/sense.rst lists the checks."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from itertools import combinations, permutations, product
from typing import Any

import numpy as np

from vtkmuscle.core.attachments.patches import ring_length, short_ring
from vtkmuscle.core.mesh.sampling import samples_inside
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.mesh.surface import diagonal, mean_thickness, signed_volume
from vtkmuscle.core.moment_arms.levers import largest_turns, twists_by
from vtkmuscle.core.motion.coordinates import ANGLES
from vtkmuscle.core.motion.rigid import apply_transform, inverse
from vtkmuscle.core.types import Floats
from vtkmuscle.data.anatomy import JOINTS, stem_of
from vtkmuscle.data.attachments import ROLES, AttachmentArea
from vtkmuscle.scene.data import MILLIMETRES, Anatomy, Finding, Muscle, RestSurface, SceneData, SceneError

#: Plausible longest sides of all bones and muscles [mm]: the tallest person was 2720 mm. Ten times the length
#: is certainly in another unit.
SHORTEST, LONGEST, SURE_LONGEST = 10.0, 3000.0, 30_000.0
#: Largest plausible muscle [mm^3]: six times the largest muscles of adults, gluteus maximus and vastus
#: lateralis (Handsfield et al. 2014, doi:10.1016/j.jbiomech.2013.12.002).
LARGEST = 5e6
#: Limits that are lengths hold for muscles of this size, the cube root of the volume [mm], and are in
#: proportion for other muscles, so that a mouse is judged as a man is. Muscles of a hip and a knee have 23
#: (quadratus femoris) to 91 (gluteus maximus).
FULL_SIZE = 50.0
#: Median distance of landmarks off their bone, in mean thicknesses 2 V / A of the muscle: half of a ring
#: round the end of a rod beside its bone may be the rod's whole thickness off, which is twice its 2 V / A. Of
#: landmarks from another scene, in lengths of the muscle.
FAR_LANDMARKS, LOST_LANDMARKS = 2.0, 1.5
#: Landmarks belong to another bone at this distance from their own [mm], and closer to the other by a factor.
OTHER_BONE, NEARER = 2.0, 2.0
#: Length of a ring relative to the shortest order: probably, and certainly in wrong order.
RING, SURE_RING = 1.05, 2.5
#: Distance from the origin, in sizes of the surface, beyond double precision.
LOST_PRECISION = 1e9
#: Least confidence of a guess that is used without a look: more likely right than wrong.
SURE = 0.5
#: Implausible depth of a muscle in a bone at rest [mm]: muscles and bones segmented from the same images
#: overlap by up to 2.3 mm, where the limit is 3.0 (LHDL hip). Also the least extent of a part of a bone in a
#: muscle: a spur of that pelvis is 1.9 mm long.
DEEP = 4.0
#: Share of a muscle inside of another one: half of it is two things in one position. Samples of a muscle.
SHARED, _SHARED_SAMPLES = 0.5, 256
#: Most points of a bone that are checked: 2 mm apart, on the largest.
_MOST_POINTS = 20_000
#: Most landmarks of a ring that are checked.
_MOST_LANDMARKS = 150


def check_sense(scene: SceneData) -> list[SceneError]:
    """Warn about probable mistakes in a scene, and return them; SceneError for a certain mistake."""
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
        problem = "the bone encloses no volume, so muscles will pass through"
        remedy = "export a closed surface, if a muscle can touch the bone"
        yield Finding(f"bones.{name}.surface", problem, remedy)
    for name, muscle in scene.muscles.items():
        surface = anatomy.muscles[name]
        for number, area in enumerate(muscle.attachments):
            yield from _ring(f"muscles.{name}.attachments[{number}].landmarks", area, surface, scene.units)
        yield from _on_bones(scene.millimetres, name, muscle, anatomy)
        yield from _in_bones(scene.millimetres, name, anatomy)
    if scene.muscle_contact != "off":
        yield from _twice(anatomy)
    yield from _guessed(scene)
    yield from _coordinates(scene)
    yield from _steps(scene, anatomy)
    yield from _gaps(scene, anatomy)


def _position(point: Any) -> str:
    return f"({', '.join(f'{value:.4g}' for value in point)})"


def _sizes(units: str, anatomy: Anatomy) -> Iterator[Finding]:
    longest = max(float(np.ptp(surface.points, axis=0).max()) for surface in anatomy.surfaces.values())
    offset = max(float(np.abs(surface.points).max()) for surface in anatomy.surfaces.values())
    if offset > LOST_PRECISION * longest > 0.0:
        problem = f"the surface is {offset:.3g} {units} from the origin, too far for its shape"
        yield Finding("", problem, "move the scene to the origin", certain=True)
    volumes = {name: abs(signed_volume(*surface)) for name, surface in anatomy.muscles.items()}
    largest = max(volumes, key=lambda name: volumes[name])

    fitting = [
        unit
        for unit in ("mm", "m", "cm")
        if SHORTEST <= longest * MILLIMETRES[unit] <= LONGEST
        and volumes[largest] * MILLIMETRES[unit] ** 3 <= LARGEST
    ]
    if units in fitting:
        return
    size = MILLIMETRES[units]
    problem = f"the longest bone or muscle is {longest * size:.3g} mm long"
    if volumes[largest] * size**3 > LARGEST:
        problem += f" and {largest!r} has {volumes[largest] * size**3 / 1e6:.3g} litres"
    remedy = "check the unit of the files, and remove stray points"
    if fitting:
        remedy = f'if the files are in {fitting[0]}, write units = "{fitting[0]}"'
    yield Finding("units", f"{problem} in the scene's unit", remedy, longest * size > SURE_LONGEST)


def _ring(key: str, area: AttachmentArea, muscle: RestSurface, units: str) -> Iterator[Finding]:
    """Yield implausible orders and positions of an area's landmarks."""
    landmarks = np.asarray(area.landmarks, dtype=np.float64)
    size = diagonal(landmarks)
    if len(landmarks) > 1 and size <= 1e-9 * diagonal(muscle.points):
        problem = f"all {len(landmarks)} landmarks coincide"
        yield Finding(key, problem, "give the boundary of the area", certain=True)
        return
    if area.estimated or not area.closed or len(landmarks) < 4:
        return
    landmarks = landmarks[:: -(-len(landmarks) // _MOST_LANDMARKS)]
    best = landmarks[short_ring(landmarks)]
    length, shortest = ring_length(landmarks), ring_length(best)
    if length > RING * shortest:
        problem = f"the ring through the landmarks is {length:.4g} {units} long, {length / shortest:.3g} "
        problem += "times as long as in another order: the landmarks are not in the order of the boundary"
        yield Finding(key, problem, "order the landmarks along the boundary", length > SURE_RING * shortest)


def _guessed(scene: SceneData) -> Iterator[Finding]:
    """Yield guesses of attachments, joints and the unit that are not sure."""
    for name, muscle in scene.muscles.items():
        for number, area in enumerate(muscle.attachments):
            if area.confidence is not None and area.confidence < SURE:
                problem = f"the {area.role} is estimated on {area.bone!r} with low confidence "
                remedy = "give landmarks; or compare the area with the muscle, and remove its confidence"
                key = f"muscles.{name}.attachments[{number}]"
                yield Finding(key, f"{problem}({area.confidence:.2f})", remedy)
    for key, confidence in scene.guessed.items():
        if confidence < SURE:
            remedy = "compare with the bones; then correct it, or remove the key from [guessed]"
            yield Finding(f"guessed.{key}", f"is a guess with low confidence ({confidence:.2f})", remedy)


def _twice(anatomy: Anatomy) -> Iterator[Finding]:
    """Yield muscles that lie in one another."""
    boxes = {name: (m.points.min(axis=0), m.points.max(axis=0)) for name, m in anatomy.muscles.items()}
    for (name, own), (other, theirs) in permutations(boxes.items(), 2):
        if (np.minimum(own[1], theirs[1]) <= np.maximum(own[0], theirs[0])).any():
            continue
        points = anatomy.muscles[name].points
        samples = samples_inside(solids_of(*anatomy.muscles[name]).inside, points, _SHARED_SAMPLES)
        share = float(solids_of(*anatomy.muscles[other]).inside(samples).mean())
        if share > SHARED:
            problem = f"{share:.0%} of the muscle lies in the muscle {other!r}: they are the same, or overlap"
            remedy = "give each muscle its own surface, or leave out either"
            yield Finding(f"muscles.{name}.surface", problem, remedy)


def _scale(muscle: RestSurface, millimetres: float) -> float:
    return millimetres * float(np.cbrt(abs(signed_volume(*muscle)))) / FULL_SIZE


def _in_bones(millimetres: float, name: str, anatomy: Anatomy) -> Iterator[Finding]:
    """Yield bones deep in a muscle at rest, or around a muscle."""
    muscle = anatomy.muscles[name]
    scale = _scale(muscle, millimetres)
    remedy = "correct the surfaces until muscle and bone only touch; attached parts stay inside"
    for bone, surface in anatomy.bones.items():
        few = surface.points[:: 1 + len(surface.points) // _MOST_POINTS]
        for inner, outer, points, solids, spread in (
            ("the muscle", f"the bone {bone!r}", muscle.points, surface.solids, 0.0),
            (f"the bone {bone!r}", "the muscle", few, solids_of(*muscle), DEEP),
        ):
            within = np.flatnonzero(solids.inside(points))  # much faster than the depth of every point
            depths = np.zeros(len(points))
            depths[within] = millimetres * solids.depth(points[within])
            deep = points[depths > DEEP * scale]
            if len(deep) and millimetres * diagonal(deep) >= spread * scale:
                where = _position(points[np.argmax(depths)])
                problem = f"at rest {inner} is up to {depths.max():.2g} mm deep in {outer}, at {where}, "
                problem += f"with {(depths > 0.0).mean():.0%} of the points"
                yield Finding(f"muscles.{name}.surface", problem, remedy)
                break


def _on_bones(millimetres: float, name: str, muscle: Muscle, anatomy: Anatomy) -> Iterator[Finding]:
    """Yield landmarks away from the bone named for them."""
    key = f"muscles.{name}.attachments"
    length = diagonal(anatomy.muscles[name].points) * millimetres
    scale = _scale(anatomy.muscles[name], millimetres)
    thickness = mean_thickness(*anatomy.muscles[name]) * millimetres
    areas = {number: area for number, area in enumerate(muscle.attachments) if area.role in ROLES}
    away, medians, nearest = {}, {}, {}
    for number, area in areas.items():
        gaps_to = {bone: surface.solids.distances(area.landmarks) for bone, surface in anatomy.bones.items()}
        away[number] = {bone: millimetres * np.abs(gaps) for bone, gaps in gaps_to.items()}
        far = medians[number] = {bone: float(np.median(gaps)) for bone, gaps in away[number].items()}
        other = min(far, key=far.__getitem__)
        if far[area.bone] > max(OTHER_BONE * scale, NEARER * far[other]):
            nearest[number] = other
    exchanged = {(areas[number].bone, bone) for number, bone in nearest.items()}
    if len(areas) == len(nearest) > 1 and exchanged == {(b, a) for a, b in exchanged}:
        problem = "origin and insertion are exchanged: the landmarks of each are on the opposite bone"
        yield Finding(key, problem, "exchange the landmarks, or the bones", certain=True)
        return
    for number, area in areas.items():
        where, own = f"{key}[{number}].landmarks", medians[number][area.bone]
        lost = float(away[number][area.bone].min()) > LOST_LANDMARKS * length
        if number in nearest and not lost:
            other = nearest[number]
            problem = f"the landmarks are {own:.3g} mm from {area.bone!r}, but "
            problem += f"{medians[number][other]:.3g} mm from {other!r}"
            yield Finding(where, problem, f'if {other!r} is right, write bone = "{other}"')
        elif own > FAR_LANDMARKS * thickness:
            problem = f"the landmarks are {own:.3g} mm from their bone {area.bone!r}"
            yield Finding(where, problem, "check the bone, and unit and frame of both", lost)
    bones = {area.bone for area in areas.values()}
    if len(areas) > 1 and len(bones) == 1:
        problem = f"all areas are on the bone {bones.pop()!r}: the muscle will move with the bone, undeformed"
        yield Finding(key, problem, "check the bones of the areas")


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
        stems = {bone: set(stem_of(bone).split("_")) for bone in scene.bones}
        ends = [[bone for bone in stems if stems[bone] & set(of)] for of in (kind.children, kind.parents)]
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
    """Yield the largest jump of the motion. Steps are of all bones, as bones on a grid move in turn."""
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
