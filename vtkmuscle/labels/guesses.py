"""Guesses in a drafted scene, each with a confidence; joints by names and fits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError, fault_of
from vtkmuscle.core.mesh.normals import triangle_normals, vertex_normals
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.types import MOST_ROUNDS, Bools, Floats
from vtkmuscle.data.anatomy import JOINTS, JointKind, has_word, side_of, stem_of
from vtkmuscle.data.arrays import checked_surface
from vtkmuscle.scene.sense import CHECKS

#: Confidence below which a guess should be checked before the results are used.
LOOK = CHECKS["estimate"]["confidence"]
#: Value of a guess about a structure that is missing in the scene.
LEFT_OUT = "left out"

#: Tables of joints by name.
Joints = dict[str, dict[str, Any]]
#: First and last angle [degrees] of a drafted motion, by coordinate.
Sweep = dict[str, tuple[float, float]]


@dataclass(frozen=True)
class Guess:
    """A guess for ``what``, a key of a scene such as ``joints.hip_right.centre``.

    ``value`` may be "", ``confidence`` is from 0 to 1, ``why`` is the reason, or the missing information.
    """

    what: str
    value: str
    confidence: float
    why: str

    def __str__(self) -> str:
        mark = "  CHECK THIS" if self.confidence < LOOK else ""
        return f"confidence {self.confidence:.2f}: {self.why}{mark}"


def table_of(guesses: Sequence[Guess]) -> list[list[str]]:
    """Return a table of guesses by ascending confidence."""
    rows = sorted(guesses, key=lambda guess: guess.confidence)
    cells = [[f"{guess.confidence:.2f}", guess.what, guess.value, guess.why] for guess in rows]
    return [["confidence", "what", "guess", "why"], *cells]


#: Largest distance of a point from its ball, in radii; smallest cosine between its normal and the radius.
#: With 0.03 or 0.95 the joint of an elbow is not found; with 0.12 or without the cosine the centres of two
#: hips, a knee, an elbow and a shoulder change by up to 3.7 mm, the axes by up to 3.6 degrees.
NEAR, ALONG = 0.06, 0.9
#: Part of the whole ball from which on a fit is fully sure; a femur's head covers 0.7 to 0.9 (five subjects),
#: the back of a condyle 0.3 (one subject).
_COVERED = {"ball": 0.5, "hinge": 0.25}
#: Fewest points of a ball: three for each of its four numbers.
_FEWEST = 12


@dataclass(frozen=True, eq=False)
class JointFit:
    """A ball fitted to a bone, or two balls side by side."""

    centre: Floats  # (3,), of the ball, or the middle between two [mm]
    axis: Floats | None  # (3,), unit vector from one ball's centre to the other's
    radius: float  # of two balls the mean [mm]
    rms: float  # of the distances of points from the ball, of two the larger [mm]
    covered: float  # area of the points as a part of the whole ball's, of two the smaller

    @property
    def confidence(self) -> float:
        """Confidence from 0, off the ball, to 1, exactly on the ball and all round."""
        flat = max(0.0, 1.0 - self.rms / (NEAR * self.radius))
        return float(flat * min(1.0, self.covered / _COVERED["ball" if self.axis is None else "hinge"]))


def fitted_ball(points: Floats, normals: Floats, areas: Floats, seeds: Bools) -> JointFit:
    """Return the ball fitted around seeds on a bone.

    Least squares in rounds: first of the seeds (n,), then of all points on the previous ball. The bone has
    points (n, 3) [mm], unit normals, outward, and areas around each point. A ball with fewer than 12 points
    raises a ValueError.
    """
    chosen = seeds
    for _ in range(MOST_ROUNDS):
        _check_enough(chosen)
        weights = areas[chosen, None] ** 0.5
        # |p|^2 = 2 c.p + (r^2 - |c|^2), about a point nearby
        origin = points[chosen].mean(axis=0)
        local = points[chosen] - origin
        equations = np.column_stack([2.0 * local, np.ones(len(local))])
        ball = np.linalg.lstsq(weights * equations, weights[:, 0] * (local**2).sum(axis=1), rcond=None)[0]
        radius, centre = float(np.sqrt(ball[3] + ball[:3] @ ball[:3])), origin + ball[:3]
        away = points - centre
        distance = np.linalg.norm(away, axis=1)
        facing = np.einsum("ij,ij->i", away, normals) > ALONG * distance
        last, chosen = chosen, (np.abs(distance - radius) < NEAR * radius) & facing
        if np.array_equal(last, chosen):
            break
    _check_enough(chosen)
    rms = float(np.sqrt(((distance[chosen] - radius) ** 2).mean()))
    return JointFit(centre, None, radius, rms, float(areas[chosen].sum() / (4.0 * np.pi * radius**2)))


def fitted_hinge(points: Floats, normals: Floats, areas: Floats, seeds: Bools) -> JointFit:
    """Return the axis through two condyle balls, each fitted as by :func:`fitted_ball`.

    Condyles lie side by side, along the longest extent of the seeds. The balls are fitted to the points
    facing the opposite bone, or to the points protruding most from the line of the shaft, as at the back of a
    femur's condyles; the surer fit is taken. Eckhoff et al. 2007, *Difference between the epicondylar and
    cylindrical axis of the knee*, doi:10.1097/BLO.0b013e318112416b.
    """
    _check_enough(seeds)
    centre = points[seeds].mean(axis=0)
    across = np.linalg.svd(points[seeds] - centre, full_matrices=False)[2][0]
    reach = float(np.abs((points[seeds] - centre) @ across).max())
    end = np.linalg.norm(points - centre, axis=1) < 2.0 * reach
    away = centre - np.average(points, axis=0, weights=areas)
    along = away - (away @ across) * across
    along /= np.linalg.norm(along)
    back = (centre - points) @ along
    shaft = points[(back > 2.0 * reach) & (back < 4.0 * reach)]
    starts = [seeds]
    if len(shaft):
        behind = np.cross(along, across)
        off = (points - shaft.mean(axis=0)) @ behind
        behind *= np.sign(off[end].max() + off[end].min())
        off = points @ behind
        starts.append(end & (normals @ behind > 0.5) & (off > off[end].max() - 0.5 * reach))
    fits, problem = [], InputError("", "the bone has no two condyles", "give the axis yourself")
    for start in filter(np.any, starts):
        side = (points - points[start].mean(axis=0)) @ across
        try:
            condyles = (start & (side * sign > 0.0) for sign in (1, -1))
            first, second = (fitted_ball(points, normals, areas, condyle) for condyle in condyles)
        except InputError as error:
            problem = error
            continue
        axis, radius = first.centre - second.centre, 0.5 * (first.radius + second.radius)
        length = float(np.linalg.norm(axis))
        if length > 0.5 * radius:  # two balls in the same position give no axis
            middle, covered = 0.5 * (first.centre + second.centre), min(first.covered, second.covered)
            fits.append(JointFit(middle, axis / length, radius, max(first.rms, second.rms), covered))
    if not fits:
        raise problem
    return max(fits, key=lambda fit: fit.confidence)


def _check_enough(chosen: Bools) -> None:
    if chosen.sum() < _FEWEST:
        raise InputError("", "the end of the bone at the joint is not round", "give the joint's centre")


#: Points of a bone face the other bone within this distance beyond the closest point [mm]. From 3 to 15 mm,
#: the centres of five hips and of a shoulder change by at most 0.5 mm.
FACING = 10.0


def guessed_joints(
    bones: Mapping[str, vtkPolyData], frame: str = "LPS", facing: float = FACING
) -> tuple[Joints, Sweep, list[Guess]]:
    """Return tables of joints by name, first and last angles [degrees] by coordinate, and guesses."""
    joints: Joints = {}
    sweep: Sweep = {}
    guesses: list[Guess] = []
    for child in bones:
        parents = ((kind, _parent(kind, child, bones)) for kind in JOINTS)
        kind, parent = next((pair for pair in parents if pair[1]), (JOINTS[0], None))
        if parent is None:
            continue
        side = side_of(child) or side_of(parent)
        named = f"{{}}_{side}" if side else "{}"
        form, name = kind.form, named.format(kind.name)
        if name in joints:  # of another part of the child, such as a tibia beside a shank
            parent, form = joints[name]["child"], "weld"
        if form == "weld":
            name = named.format(stem_of(child))
        table: dict[str, Any] = {"parent": parent, "child": child, "type": form}
        key = f"joints.{name}"
        if form == "weld":
            why = f"{child!r} moves with {parent!r}, by its name"
            guesses.append(Guess(f"{key}.parent", parent, 0.5, why))
        else:
            try:
                fit = _fit(kind, bones[child], bones[parent], facing)
            except ValueError as error:
                problem, remedy = fault_of(error)
                guesses.append(Guess(key, "", 0.0, f"{problem}: {child} does not move; {remedy}"))
                continue
            table |= _axes(kind, fit, side, frame)
            sweep[next(iter(table["coordinates"]))] = 0.0, kind.most
            guesses += _guesses_of(key, kind, fit, bones[child], frame)
        joints[name] = table
    return joints, sweep, guesses


def _parent(kind: JointKind, child: str, bones: Mapping[str, vtkPolyData]) -> str | None:
    """Return a bone's parent for a kind of joint, or None."""
    if not has_word(child, kind.children):
        return None
    sides = {"left", "right", None} if side_of(child) is None else {side_of(child), None}
    near = [bone for bone in bones if bone != child and side_of(bone) in sides]
    return next((bone for word in kind.parents for bone in near if has_word(bone, [word])), None)


def _fit(kind: JointKind, child: vtkPolyData, parent: vtkPolyData, depth: float) -> JointFit:
    rounded, facing = (child, parent) if kind.round_end == "child" else (parent, child)
    points, triangles = checked_surface(rounded, "bone")
    areas = np.linalg.norm(triangle_normals(points, triangles), axis=1) / 6.0
    areas = np.bincount(triangles.ravel(), np.repeat(areas, 3), len(points)).astype(np.float64)
    distances = solids_of(*checked_surface(facing, "bone")).distances(points)
    fitted = fitted_ball if kind.form == "ball" else fitted_hinge
    return fitted(points, vertex_normals(points, triangles), areas, distances < distances.min() + depth)


def _axes(kind: JointKind, fit: JointFit, side: str | None, frame: str) -> dict[str, Any]:
    """Return the keys of a joint: centre, axes and coordinates."""
    flip = np.array([-1.0, -1.0, 1.0]) if frame == "RAS" else np.ones(3)
    suffix = f"_{side[0]}" if side else ""
    signs = [1.0, -1.0, -1.0] if side == "left" else [1.0, 1.0, 1.0]
    axes = [sign * flip * np.array(axis) for sign, axis in zip(signs, kind.axes.values(), strict=False)]
    if fit.axis is not None:
        axes = [fit.axis * (1.0 if fit.axis @ axes[0] >= 0.0 else -1.0)]
    coordinates = {f"{name}{suffix}": {"positive": name.split("_")[1]} for name in kind.axes}
    listed = [[round(float(value), 6) for value in axis] for axis in axes]
    turns = {"axes": listed} if kind.form == "ball" else {"axis": listed[0]}
    return {"centre": [round(float(value), 3) for value in fit.centre], **turns, "coordinates": coordinates}


def _guesses_of(key: str, kind: JointKind, fit: JointFit, child: vtkPolyData, frame: str) -> list[Guess]:
    shape = "a ball" if kind.form == "ball" else "two balls side by side"
    sizes = f"radius {fit.radius:.1f} mm, error {fit.rms:.2f} mm, {100 * fit.covered:.0f} % covered"
    centre = ", ".join(f"{value:.1f}" for value in fit.centre)
    hanging = checked_surface(child, "bone")[0].mean(axis=0) - fit.centre
    down = max(0.0, float(-hanging[2] / np.linalg.norm(hanging)))
    confidence = down if fit.axis is None else down * fit.confidence
    why = f"signs for a standing person in {frame}; the bone hangs down by {down:.2f} of its length"
    axes = Guess(f"{key}.{'axes' if fit.axis is None else 'axis'}", ", ".join(kind.axes), confidence, why)
    return [Guess(f"{key}.centre", centre, fit.confidence, f"{shape}: {sizes}"), axes]


def moving_chain(bone: str, joints: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the bones with moving joints from a bone upwards."""
    above = {table["child"]: table for table in joints.values()}
    chain = []
    while bone in above:
        chain += [bone] if above[bone]["type"] != "weld" else []
        bone = above[bone]["parent"]
    return chain
