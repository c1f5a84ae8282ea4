"""Implausible scenes: reported before the run, as an error where the mistake is certain, else as a warning.

The checks are listed in docs/reference/sense.rst.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from vtkmuscle.core.attachments.rings import ring_area, ring_length, short_ring
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.data.attachments import VIA, AttachmentArea
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.filters.pbd_deformer import PBDDeformer
from vtkmuscle.scene.data import MILLIMETRES, Anatomy, Muscle, SceneData, Surface
from vtkmuscle.scene.faults import SceneError
from vtkmuscle.scene.sense_motion import motion_findings

#: A muscle farther from its bones than this is not on them [mm].
CLEARANCE = 10.0
#: Why settings of the solver change nothing in a scene of paths.
UNSOLVED = "model is 'paths', in which no muscle is solved"


def settings_findings(scene: SceneData, anatomy: Anatomy) -> Iterator[tuple[str, str, str, bool]]:
    """Give a finding for each implausible setting."""
    yield from (_idle_finding(*one) for one in _idle_of_scene(scene))
    for table, kind in (("solver", PBDDeformer), ("fixing", FixedPointDetector)):
        idle: dict[str, list[str]] = {}
        for name, muscle in scene.muscles.items():
            own, given = getattr(muscle, table), getattr(scene, f"{table}_of")(name)
            reasons = dict(_idle(kind, given))
            if table == "solver" and scene.model == "paths":
                reasons = dict.fromkeys(given, UNSOLVED)
            if table == "fixing":
                reasons |= _idle_distance(given, muscle.attachments)
            for setting in own.keys() & reasons.keys():
                yield _idle_finding(f"muscles.{name}.{table}.{setting}", reasons[setting])
            for setting in getattr(scene, table).keys() & (reasons.keys() | own.keys()):
                idle.setdefault(setting, []).append(reasons.get(setting, "every muscle has its own"))
        for setting, found in idle.items():
            if len(found) == len(scene.muscles):
                yield _idle_finding(f"{table}.{setting}", found[0])
    for name, muscle in scene.muscles.items():
        clearance = scene.millimetres * scene.solver_of(name).get("bone_clearance", 0.0)
        if clearance > CLEARANCE:
            key = f"muscles.{name}.solver" if "bone_clearance" in muscle.solver else "solver"
            size = scene.millimetres * float(np.ptp(anatomy.muscles[name].points, axis=0).max())
            problem = f"{name!r} is kept {clearance:.3g} mm away from the bones"
            yield f"{key}.bone_clearance", problem, f"give at most {CLEARANCE:g} mm", clearance > size


def _idle_of_scene(scene: SceneData) -> Iterator[tuple[str, str]]:
    """Give the settings of a scene and of its fibres that say nothing beside others, and why."""
    if scene.model == "paths" and scene.quality is not None:
        yield "quality", UNSOLVED
    if scene.muscle_contact != "off" and len(scene.muscles) == 1:
        yield "muscle_contact", "there is one muscle"
    for name, muscle in scene.muscles.items():
        fibres = muscle.fibres or {}
        for setting, is_idle, reason in (
            ("weight_tolerance", scene.model == "paths", UNSOLVED),
            ("template", "template_file" in fibres, "template_file has a template"),
            ("smoothing_weight", fibres.get("smoothing_passes") == 0, "smoothing_passes is 0"),
        ):
            if is_idle and setting in fibres:
                yield f"muscles.{name}.fibres.{setting}", reason


def _idle_finding(key: str, reason: str) -> tuple[str, str, str, bool]:
    return key, f"it changes nothing: {reason}", "leave it out", False


def _idle(kind: type[Filter], given: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Give the settings of a filter that say nothing beside the others, and why."""
    values = kind(**given).parameters()
    for name in given:
        declared = kind.parameter_declarations[name]
        if not declared.counts_with(values):
            yield name, declared.condition.strip().removesuffix(".").lower()
    if kind is PBDDeformer and "dt" in given and not any(values["external_force"]):
        yield "dt", "without external_force a step of any time is the same"


def _idle_distance(given: Mapping[str, Any], areas: Sequence[AttachmentArea]) -> dict[str, str]:
    method = given.get("method", FixedPointDetector.parameter_declarations["method"].default)
    curves = method == "attachment" and any(not one.closed and one.role != VIA for one in areas)
    if "distance" not in given or method == "proximity" or curves:
        return {}
    return {"distance": "it is for the method 'proximity', and for areas that are open curves"}


#: The longest side of all bones and muscles: what is shorter or longer is in another unit [mm]. The tallest
#: person was 2720 mm.
SHORTEST, LONGEST = 10.0, 3000.0
#: A muscle that is larger is in another unit [mm^3]: six times the largest ones of adults, gluteus maximus
#: and vastus lateralis (Handsfield et al. 2014, doi:10.1016/j.jbiomech.2013.12.002).
LARGEST = 5e6
#: Landmarks farther than this from their bone, in the middle, are not on it; farther than the second, or
#: than the muscle is long, all of them: they are another scene's [mm].
FAR_LANDMARKS, LOST_LANDMARKS = 10.0, 300.0
#: Landmarks are another bone's if they are this far from their own [mm], and nearer to the other by a factor.
OTHER_BONE, NEARER = 2.0, 2.0
#: The ring through landmarks, in parts of the shortest one: another order was meant; surely so.
RING, SURE_RING = 1.05, 2.5
#: 4 pi area / length^2 of a ring that encloses nothing worth speaking of; 1 for a circle.
FLAT_RING = 0.01
#: Area of a ring, as a part of that of the shortest: one that crosses itself encloses less.
CROSSED_RING = 0.6
#: Distance of a point from the middle, in units of the median of all: one that strayed; surely so.
STRAY, SURE_STRAY = 30.0, 1000.0
#: Distance from the origin, in sizes of the surface, at which double precision has lost it.
LOST_PRECISION = 1e9
#: An estimated attachment that is less sure may well be on another bone: the muscle reaches that one too, but
#: for this part of its length. On the right bones of 31 muscles it is 0.12 or surer.
SURE_ESTIMATE = 0.05
#: A muscle that lies deeper in a bone at rest is pushed out by so much in the first frame; muscles and bones
#: segmented from the same images overlap by up to 2.3 mm (LHDL hip) [mm]. What of a bone is deeper in a
#: muscle is as long at least; a spur of that pelvis, 1.9 mm long, is not.
DEEP = 3.0
#: Roles of areas that lie on a bone; a ring that a muscle passes through need not.
ENDS = ("origin", "insertion")
#: Points of a bone that are looked at, at most: 2 mm apart, on the largest.
_MOST_POINTS = 20_000
#: Points of a ring that are looked at.
_MOST_LANDMARKS = 150


#: Where, what is odd, what to do about it, and whether nothing useful can come of it.
Finding = tuple[str, str, str, bool]


def check_sense(scene: SceneData, anatomy: Anatomy | None = None) -> list[str]:
    """Report what is implausible in a scene, and return the warnings; its surfaces may be open already.

    Raises
    ------
    SceneError
        For the first certain mistake.

    Warns
    -----
    UserWarning
        For each probable mistake.
    """
    said = []
    for key, problem, remedy, sure in sorted(
        findings(scene, anatomy or Anatomy.of(scene)), key=lambda one: not one[-1]
    ):
        file = scene.files.get(key, scene.files.get(""))
        error = SceneError(problem, key, remedy, file)
        if sure:
            raise error
        said.append(str(error))
        warnings.warn(said[-1], stacklevel=5)  # through run_scene, to who runs a scene
    return said


def findings(scene: SceneData, anatomy: Anatomy) -> Iterator[Finding]:
    """Give a finding for each implausible thing."""
    strayed = list(_strays(scene.units, anatomy))
    yield from strayed
    if any(finding[-1] for finding in strayed):
        return  # measures of the rest would mean nothing
    yield from _sizes(scene.units, anatomy)
    yield from _twice(anatomy)
    yield from _bones_without_inside(anatomy)
    for name, muscle in scene.muscles.items():
        surface = anatomy.muscles[name]
        for number, area in enumerate(muscle.attachments):
            yield from _ring(f"muscles.{name}.attachments[{number}].landmarks", area, surface, scene.units)
        yield from _on_bones(scene.millimetres, name, muscle, anatomy)
        yield from _estimates(name, muscle)
        yield from _in_bones(scene.millimetres, name, anatomy)
    yield from motion_findings(scene, anatomy)
    yield from settings_findings(scene, anatomy)


def _strays(units: str, anatomy: Anatomy) -> Iterator[Finding]:
    """Give surfaces with a point that is nowhere near the others, or that lie nowhere near the origin."""
    for key, surface in anatomy.surfaces.items():
        points = surface.points
        centre = np.median(points, axis=0)
        with np.errstate(over="ignore"):
            away = np.linalg.norm(points - centre, axis=1)
            offset = float(np.linalg.norm(centre))
        typical, farthest = float(np.median(away)), float(away.max())
        if farthest > STRAY * typical > 0.0:
            point = int(np.argmax(away))
            where = ", ".join(f"{value:.4g}" for value in points[point])
            problem = (
                f"point {point} at ({where}) is {farthest / typical:.3g} times as far off as most points"
            )
            yield key, problem, "correct that point, or remove it", farthest > SURE_STRAY * typical
        if offset > LOST_PRECISION * farthest > 0.0:
            problem = f"it lies {offset:.3g} {units} from the origin, which leaves no digits for its shape"
            yield key, problem, "move the scene to the origin", True


def _sizes(units: str, anatomy: Anatomy) -> Iterator[Finding]:
    longest = max(float(np.ptp(one.points, axis=0).max()) for one in anatomy.surfaces.values())
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
    remedies = [
        f'if the files are in {unit}, write units = "{unit}"' for unit in ("mm", "m", "cm") if fits(unit)
    ]
    yield "units", f"{problem} in this unit", (remedies or ["check the unit of the files"])[0], False


def _twice(anatomy: Anatomy) -> Iterator[Finding]:
    """Give surfaces that stand for two things."""
    seen: dict[bytes, str] = {}
    for key, surface in anatomy.surfaces.items():
        other = seen.setdefault(np.ascontiguousarray(surface.points).tobytes(), key)
        if other != key and other.startswith("bones."):  # two muscles may be one, solved in two ways
            yield key, f"it is the same surface as {other}", "name the file that belongs to it", False


def _bones_without_inside(anatomy: Anatomy) -> Iterator[Finding]:
    solid = anatomy.solid_bones
    for name in anatomy.bones:
        if name not in solid:
            problem = "the bone encloses no volume: no muscle will be kept out of it"
            remedy = "export it again as a closed surface, if a muscle can meet it"
            yield f"bones.{name}.surface", problem, remedy, False


def _ring(key: str, area: AttachmentArea, muscle: Surface, units: str) -> Iterator[Finding]:
    """Give what is odd about the order and place of landmarks."""
    landmarks = np.asarray(area.landmarks, dtype=np.float64)
    size = float(np.linalg.norm(np.ptp(landmarks, axis=0)))
    if len(landmarks) > 1 and size <= 1e-9 * float(np.linalg.norm(np.ptp(muscle.points, axis=0))):
        yield key, f"all {len(landmarks)} landmarks are one point", "give the boundary of the area", True
        return
    if area.estimated or not area.closed or len(landmarks) < 4:
        return
    landmarks = landmarks[:: -(-len(landmarks) // _MOST_LANDMARKS)]
    best = landmarks[short_ring(landmarks)]
    length, shortest = ring_length(landmarks), ring_length(best)
    remedy = "put them in order along the boundary"
    if length > RING * shortest:
        problem = (
            f"the ring through the landmarks is {length:.4g} {units} long, {length / shortest:.3g} "
            "times as long as in another order: they are not in the order of the boundary"
        )
        yield key, problem, remedy, length > SURE_RING * shortest
    elif 4.0 * np.pi * ring_area(best) < FLAT_RING * shortest**2:
        remedy = "if it is a line and no area, write closed = false"
        yield key, "the ring through the landmarks encloses hardly any area", remedy, False
    elif ring_area(landmarks) < CROSSED_RING * ring_area(best):
        yield key, "the ring through the landmarks crosses itself, as an 8 does", remedy, False


def _estimates(name: str, muscle: Muscle) -> Iterator[Finding]:
    """Give estimated attachments that may well be on another bone."""
    for area in muscle.attachments:
        if area.sureness is not None and area.sureness < SURE_ESTIMATE:
            problem = (
                f"the {area.role} was estimated to be on {area.bone!r}, but is not sure ({area.sureness:.2f})"
            )
            remedy = 'name both bones, { estimate = ["ORIGIN", "INSERTION"] }, or give landmarks'
            yield f"muscles.{name}.attachments", problem, remedy, False
            return


def _in_bones(millimetres: float, name: str, anatomy: Anatomy) -> Iterator[Finding]:
    """Give bones that a muscle lies deep in at rest, or that lie deep in it."""
    muscle = anatomy.muscles[name]
    remedy = "move its surface or the bone's until they meet; only what is attached stays inside"
    for bone, surface in anatomy.bones.items():
        few = surface.points[:: 1 + len(surface.points) // _MOST_POINTS]
        for one, other, points, solids, spread in (
            ("it", f"the bone {bone!r}", muscle.points, surface.solids, 0.0),
            (f"the bone {bone!r}", "it", few, solids_of(*muscle), DEEP),
        ):
            depths = millimetres * solids.depth(points)
            deep = points[depths > DEEP]
            if len(deep) and millimetres * np.linalg.norm(np.ptp(deep, axis=0)) >= spread:
                where = ", ".join(f"{value:.4g}" for value in points[np.argmax(depths)])
                problem = f"at rest {one} is up to {depths.max():.2g} mm deep in {other}, at ({where}), "
                problem += f"with {(depths > 0.0).mean():.0%} of its points"
                yield f"muscles.{name}.surface", problem, remedy, False
                break


def _on_bones(scale: float, name: str, muscle: Muscle, anatomy: Anatomy) -> Iterator[Finding]:
    """Give landmarks that are not on the bone that they name."""
    length = float(np.linalg.norm(np.ptp(anatomy.muscles[name].points, axis=0))) * scale
    numbered = [(n, area) for n, area in enumerate(muscle.attachments) if area.role in ENDS]
    areas = [area for _, area in numbered]
    away = [
        {
            bone: scale * np.abs(surface.solids.distances(area.landmarks))
            for bone, surface in anatomy.bones.items()
        }
        for area in areas
    ]
    meant: dict[int, str] = {}
    for number, (area, far) in enumerate(zip(areas, away, strict=True)):
        own = float(np.median(far[area.bone]))
        nearest = min(far, key=lambda bone: float(np.median(far[bone])))
        if own > OTHER_BONE and NEARER * float(np.median(far[nearest])) < own:
            meant[number] = nearest
    exchanged = {(areas[number].bone, bone) for number, bone in meant.items()}
    if len(areas) == len(meant) > 1 and exchanged == {(b, a) for a, b in exchanged}:
        problem = "origin and insertion are exchanged: each has its landmarks on the other's bone"
        remedy = "exchange their landmarks, or their bones"
        yield f"muscles.{name}.attachments", problem, remedy, True
        return
    for number, (area, far) in enumerate(zip(areas, away, strict=True)):
        key = f"muscles.{name}.attachments[{numbered[number][0]}].landmarks"
        own = float(np.median(far[area.bone]))
        lost = float(far[area.bone].min()) > max(length, LOST_LANDMARKS)
        if number in meant and not lost:
            other = float(np.median(far[meant[number]]))
            problem = f"the landmarks are {own:.3g} mm from {area.bone!r}"
            problem += f", but {other:.3g} mm from {meant[number]!r}"
            yield key, problem, f'if they are on that bone, write bone = "{meant[number]}"', False
        elif own > FAR_LANDMARKS:
            problem = (
                f"the landmarks are {own:.3g} mm from the bone {area.bone!r} that they are said to be on"
            )
            yield key, problem, "check the bone, and that both are in the same unit and place", lost
    if len(areas) > 1 and len({area.bone for area in areas}) == 1:
        problem = f"all areas are on the bone {areas[0].bone!r}: the muscle will move with it as it is"
        yield f"muscles.{name}.attachments", problem, "check the bones of its areas", False
