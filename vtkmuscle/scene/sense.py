"""Implausible scenes: errors or warnings before the run; docs/reference/sense.rst lists the checks."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from itertools import permutations
from typing import Any

import numpy as np

from vtkmuscle.core.attachments.patches import ring_length, short_ring
from vtkmuscle.core.mesh.sampling import samples_inside
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.mesh.surface import diagonal, mean_thickness, signed_volume
from vtkmuscle.data.attachments import ROLES, AttachmentArea
from vtkmuscle.scene.data import MILLIMETRES, Anatomy, Muscle, RestSurface, SceneData
from vtkmuscle.scene.faults import Finding, SceneError
from vtkmuscle.scene.motion_sense import motion_findings

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


def check_sense(scene: SceneData, anatomy: Anatomy | None = None) -> list[SceneError]:
    """Warn about probable mistakes in a scene, and return them; SceneError for a certain mistake."""
    odd = []
    mistakes = findings(scene, anatomy or Anatomy.of(scene))
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
    yield from _bones_without_inside(anatomy)
    for name, muscle in scene.muscles.items():
        surface = anatomy.muscles[name]
        for number, area in enumerate(muscle.attachments):
            yield from _ring(f"muscles.{name}.attachments[{number}].landmarks", area, surface, scene.units)
        yield from _on_bones(scene.millimetres, name, muscle, anatomy)
        yield from _estimates(name, muscle)
        yield from _in_bones(scene.millimetres, name, anatomy)
    if scene.muscle_contact != "off":
        yield from _twice(anatomy)
    yield from _guessed(scene)
    yield from motion_findings(scene, anatomy)


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
    remedy = "order the landmarks along the boundary"
    if length > RING * shortest:
        problem = (
            f"the ring through the landmarks is {length:.4g} {units} long, {length / shortest:.3g} "
            "times as long as in another order: the landmarks are not in the order of the boundary"
        )
        yield Finding(key, problem, remedy, length > SURE_RING * shortest)


def _estimates(name: str, muscle: Muscle) -> Iterator[Finding]:
    """Yield the attachments that are guessed, and may be elsewhere."""
    for number, area in enumerate(muscle.attachments):
        if area.confidence is not None and area.confidence < SURE:
            problem = f"the {area.role} is estimated on {area.bone!r} with low confidence"
            remedy = (
                "give landmarks; or compare the area with the muscle, and remove confidence from the area"
            )
            key = f"muscles.{name}.attachments[{number}]"
            yield Finding(key, f"{problem} ({area.confidence:.2f})", remedy)


def _guessed(scene: SceneData) -> Iterator[Finding]:
    """Yield guesses of joints and of the unit that are not sure."""
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
            problem = (
                f"{share:.0%} of the muscle lies in the muscle {other!r}: the surfaces are the same, or "
            )
            remedy = "give each muscle its own surface, or leave out either"
            yield Finding(f"muscles.{name}.surface", f"{problem}overlap", remedy)


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
        away[number] = {
            bone: millimetres * np.abs(surface.solids.distances(area.landmarks))
            for bone, surface in anatomy.bones.items()
        }
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
