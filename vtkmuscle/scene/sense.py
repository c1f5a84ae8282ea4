"""Implausible scenes: errors or warnings before the run; docs/reference/sense.rst lists the checks."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from vtkmuscle.core.attachments.patches import ring_length, short_ring
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.types import Floats
from vtkmuscle.data.attachments import ROLES, AttachmentArea
from vtkmuscle.scene.data import MILLIMETRES, Anatomy, Muscle, RestSurface, SceneData
from vtkmuscle.scene.faults import SceneError

#: Plausible longest sides of all bones and muscles [mm]: the tallest person was 2720 mm. Ten times the length
#: is certainly in another unit.
SHORTEST, LONGEST, SURE_LONGEST = 10.0, 3000.0, 30_000.0
#: Largest plausible muscle [mm^3]: six times the largest muscles of adults, gluteus maximus and vastus
#: lateralis (Handsfield et al. 2014, doi:10.1016/j.jbiomech.2013.12.002).
LARGEST = 5e6
#: Median distance of landmarks off their bone; least distance, also above the muscle's length, of landmarks
#: from another scene [mm].
FAR_LANDMARKS, LOST_LANDMARKS = 10.0, 300.0
#: Landmarks belong to another bone at this distance from their own [mm], and closer to the other by a factor.
OTHER_BONE, NEARER = 2.0, 2.0
#: Length of a ring relative to the shortest order: probably, and certainly in wrong order.
RING, SURE_RING = 1.05, 2.5
#: Distance from the origin, in sizes of the surface, beyond double precision.
LOST_PRECISION = 1e9
#: Least confidence of an estimated attachment: below, the muscle reaches another bone but for this part of
#: its length. On the right bones of 31 muscles the confidence is 0.12 or more.
SURE_ESTIMATE = 0.05
#: Implausible depth of a muscle in a bone at rest [mm]: muscles and bones segmented from the same images
#: overlap by up to 2.3 mm (LHDL hip). Also the least extent of a part of a bone within a muscle: a spur of
#: that pelvis is 1.9 mm long.
DEEP = 3.0
#: Distance of a muscle's areas, relative to rest or to half its length: probably, and certainly torn.
TORN, SURE_TORN = 2.0, 5.0
#: Most points of a bone that are checked: 2 mm apart, on the largest.
_MOST_POINTS = 20_000
#: Most landmarks of a ring that are checked.
_MOST_LANDMARKS = 150


class Finding(NamedTuple):
    """An implausible part of a scene; ``certain`` stops runs."""

    key: str
    problem: str
    remedy: str
    certain: bool = False


def check_sense(scene: SceneData, anatomy: Anatomy | None = None) -> list[str]:
    """Warn about probable mistakes in a scene, and return the warnings; SceneError for a certain mistake."""
    messages = []
    mistakes = findings(scene, anatomy or Anatomy.of(scene))
    for key, problem, remedy, certain in sorted(mistakes, key=lambda finding: not finding.certain):
        error = SceneError(problem, key, remedy, scene.files.get(key, scene.files.get("")))
        if certain:
            raise error
        messages.append(str(error))
        warnings.warn(messages[-1], stacklevel=5)  # at the call that runs the scene
    return messages


def findings(scene: SceneData, anatomy: Anatomy) -> Iterator[Finding]:
    """Yield the implausible parts of a scene."""
    sizes = list(_sizes(scene.units, anatomy))
    yield from sizes
    if any(finding.certain for finding in sizes):
        return  # all other measures would be meaningless
    yield from _bones_without_inside(anatomy)
    for name, muscle in scene.muscles.items():
        surface = anatomy.muscles[name]
        for number, area in enumerate(muscle.attachments):
            yield from _ring(f"muscles.{name}.attachments[{number}].landmarks", area, surface, scene.units)
        yield from _on_bones(scene.millimetres, name, muscle, anatomy)
        yield from _estimates(name, muscle)
        yield from _in_bones(scene.millimetres, name, anatomy)
    for name, muscle in scene.muscles.items():
        yield from _torn(scene, name, muscle, anatomy.muscles[name])


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

    def fits(unit: str) -> bool:
        size = MILLIMETRES[unit]
        return SHORTEST <= longest * size <= LONGEST and volumes[largest] * size**3 <= LARGEST

    if fits(units):
        return
    size = MILLIMETRES[units]
    problem = f"the longest bone or muscle is {longest * size:.3g} mm long"
    if volumes[largest] * size**3 > LARGEST:
        problem += f" and {largest!r} has {volumes[largest] * size**3 / 1e6:.3g} litres"
    fitting = next((unit for unit in ("mm", "m", "cm") if fits(unit)), None)
    remedy = "check the unit of the files, and remove stray points"
    if fitting is not None:
        remedy = f'if the files are in {fitting}, write units = "{fitting}"'
    yield Finding("units", f"{problem} in the scene's unit", remedy, longest * size > SURE_LONGEST)


def _bones_without_inside(anatomy: Anatomy) -> Iterator[Finding]:
    for name in (name for name in anatomy.bones if name not in anatomy.solid_bones):
        problem = "the bone encloses no volume, so muscles will pass through"
        remedy = "export a closed surface, if a muscle can touch the bone"
        yield Finding(f"bones.{name}.surface", problem, remedy)


def _ring(key: str, area: AttachmentArea, muscle: RestSurface, units: str) -> Iterator[Finding]:
    """Yield implausible orders and positions of an area's landmarks."""
    landmarks = np.asarray(area.landmarks, dtype=np.float64)
    size = float(np.linalg.norm(np.ptp(landmarks, axis=0)))
    if len(landmarks) > 1 and size <= 1e-9 * float(np.linalg.norm(np.ptp(muscle.points, axis=0))):
        problem = f"all {len(landmarks)} landmarks coincide"
        yield Finding(key, problem, "give the boundary of the area", certain=True)
        return
    if area.estimated or not area.closed or len(landmarks) < 4:
        return
    landmarks = landmarks[:: -(-len(landmarks) // _MOST_LANDMARKS)]
    best = landmarks[short_ring(landmarks)]
    length, shortest = ring_length(landmarks), ring_length(best)
    remedy = "order the landmarks along the boundary"
    if length > RING * shortest:
        problem = (
            f"the ring through the landmarks is {length:.4g} {units} long, {length / shortest:.3g} "
            "times as long as in another order: the landmarks are not in the order of the boundary"
        )
        yield Finding(key, problem, remedy, length > SURE_RING * shortest)


def _estimates(name: str, muscle: Muscle) -> Iterator[Finding]:
    """Yield the first estimated attachment that may be on another bone."""
    for area in muscle.attachments:
        if area.confidence is not None and area.confidence < SURE_ESTIMATE:
            problem = f"the {area.role} is estimated on {area.bone!r} with low confidence"
            remedy = 'name both bones, { estimate = ["ORIGIN", "INSERTION"] }, or give landmarks'
            yield Finding(f"muscles.{name}.attachments", f"{problem} ({area.confidence:.2f})", remedy)
            return


def _in_bones(millimetres: float, name: str, anatomy: Anatomy) -> Iterator[Finding]:
    """Yield bones deep in a muscle at rest, or around a muscle."""
    muscle = anatomy.muscles[name]
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
            deep = points[depths > DEEP]
            if len(deep) and millimetres * np.linalg.norm(np.ptp(deep, axis=0)) >= spread:
                where = _position(points[np.argmax(depths)])
                problem = f"at rest {inner} is up to {depths.max():.2g} mm deep in {outer}, at {where}, "
                problem += f"with {(depths > 0.0).mean():.0%} of the points"
                yield Finding(f"muscles.{name}.surface", problem, remedy)
                break


def _on_bones(millimetres: float, name: str, muscle: Muscle, anatomy: Anatomy) -> Iterator[Finding]:
    """Yield landmarks away from the bone named for them."""
    key = f"muscles.{name}.attachments"
    length = float(np.linalg.norm(np.ptp(anatomy.muscles[name].points, axis=0))) * millimetres
    areas = {number: area for number, area in enumerate(muscle.attachments) if area.role in ROLES}
    away, medians, nearest = {}, {}, {}
    for number, area in areas.items():
        away[number] = {
            bone: millimetres * np.abs(surface.solids.distances(area.landmarks))
            for bone, surface in anatomy.bones.items()
        }
        far = medians[number] = {bone: float(np.median(gaps)) for bone, gaps in away[number].items()}
        other = min(far, key=far.__getitem__)
        if far[area.bone] > max(OTHER_BONE, NEARER * far[other]):
            nearest[number] = other
    exchanged = {(areas[number].bone, bone) for number, bone in nearest.items()}
    if len(areas) == len(nearest) > 1 and exchanged == {(b, a) for a, b in exchanged}:
        problem = "origin and insertion are exchanged: the landmarks of each are on the opposite bone"
        yield Finding(key, problem, "exchange the landmarks, or the bones", certain=True)
        return
    for number, area in areas.items():
        where, own = f"{key}[{number}].landmarks", medians[number][area.bone]
        lost = float(away[number][area.bone].min()) > max(length, LOST_LANDMARKS)
        if number in nearest and not lost:
            other = nearest[number]
            problem = f"the landmarks are {own:.3g} mm from {area.bone!r}, but "
            problem += f"{medians[number][other]:.3g} mm from {other!r}"
            yield Finding(where, problem, f'if {other!r} is right, write bone = "{other}"')
        elif own > FAR_LANDMARKS:
            problem = f"the landmarks are {own:.3g} mm from their bone {area.bone!r}"
            yield Finding(where, problem, "check the bone, and unit and frame of both", lost)
    bones = {area.bone for area in areas.values()}
    if len(areas) > 1 and len(bones) == 1:
        problem = f"all areas are on the bone {bones.pop()!r}: the muscle will move with the bone, undeformed"
        yield Finding(key, problem, "check the bones of the areas")


def _torn(scene: SceneData, name: str, muscle: Muscle, surface: RestSurface) -> Iterator[Finding]:
    """Yield a muscle whose areas move too far apart."""
    middles = [(area.bone, np.asarray(area.landmarks).mean(axis=0)) for area in muscle.attachments]
    if len({bone for bone, _ in middles}) < 2:
        return
    length = float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    spans = np.array([_span(middles, scene.motion.at(float(time))) for time in scene.motion.times])
    longest = int(np.argmax(spans))
    ratio = spans[longest] / max(_span(middles, {}), 0.5 * length)
    if ratio > TORN:
        problem = (
            f"the areas are {spans[longest]:.3g} {scene.units} apart in frame {longest}, {ratio:.3g} "
            "times as far as at rest: the muscle would tear"
        )
        remedy = "check the unit of the motion's translations; transforms lead from rest to the pose"
        yield Finding(f"muscles.{name}.attachments", problem, remedy, ratio > SURE_TORN)


def _span(middles: list[tuple[str, Floats]], pose: dict[str, Floats]) -> float:
    """Return the largest distance between two areas' centroids in a pose."""
    moved = [apply_transform(pose.get(bone, np.eye(4)), middle[None])[0] for bone, middle in middles]
    return max(float(np.linalg.norm(a - b)) for a in moved for b in moved)
