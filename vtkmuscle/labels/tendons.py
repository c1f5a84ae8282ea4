"""Tendons of muscles that were segmented without: a tube from the belly's end, taut round the bones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.label_field import LabelField
from vtkmuscle.core.mesh.solids import Solids
from vtkmuscle.core.mesh.surface import survey
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import checked_surface, surface_from
from vtkmuscle.data.isosurface import EVEN
from vtkmuscle.phantoms.implicit import Solid, thick_curve
from vtkmuscle.phantoms.meshing import mesh_of

#: A tendon is as thick as the belly is so far from its end [mm]: a round end of that radius.
INSIDE = 5.0
#: ... but no thicker than this [mm]: the radius of an Achilles tendon of 80 mm^2.
THICKEST = 5.0
#: Points of a tendon's line, and rounds in which each goes half way to the middle of its neighbours: with so
#: few points a bend spreads over all of them in less.
_POINTS, _ROUNDS = 24, 600


@dataclass(frozen=True, eq=False)
class Tendon:
    """A muscle with a tendon.

    Attributes
    ----------
    surface : vtkPolyData
        Of belly and tendon, closed.
    line : (k, 3) array
        The tendon's middle, from the belly to the bone [mm].
    radius : float
        Of the tendon [mm].
    """

    surface: vtkPolyData
    line: Floats
    radius: float

    @property
    def length(self) -> float:
        """From the belly's end to the bone [mm]."""
        return float(np.linalg.norm(np.diff(self.line, axis=0), axis=1).sum())


def with_tendon(
    belly: LabelField, surface: vtkPolyData, target: Floats, bones: Sequence[Solids], edge: float
) -> Tendon:
    """Return a belly with a tendon to a place on a bone.

    The tube begins where the belly is nearest to the place, is as thick as its end, runs as short as it can
    without entering a bone, and ends there.

    Parameters
    ----------
    belly : LabelField
        Of the label.
    surface : vtkPolyData
        Of the belly [mm].
    target : (3,) array
        The middle of the area on the bone [mm].
    bones : sequence of Solids
        What the tendon goes round.
    edge : float
        Length of the triangles' edges [mm].
    """
    points, triangles = checked_surface(surface, "belly")
    tip = points[np.argmin(np.linalg.norm(points - target, axis=1))]
    inward = points.mean(axis=0) - tip
    inward /= np.linalg.norm(inward)
    thinnest = float(belly.spacing.max())
    depth = -float(belly.at(tip[None] + INSIDE * inward)[0][0])
    radius = float(np.clip(depth, thinnest, max(thinnest, THICKEST)))
    line = taut_line(tip, target, bones, radius)
    tube = np.vstack([tip + radius * inward, line])
    solid = Solid(belly.at, points.min(axis=0), points.max(axis=0))
    solid = solid.joined(thick_curve(tube, np.full(len(tube), radius)), radius)
    report = survey(points, triangles)
    area = report.area + 2.0 * np.pi * radius * float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    made = mesh_of(solid, min(0.5 * edge, 0.7 * radius), round(area / (EVEN * edge * edge)))
    return Tendon(surface_from(*made), line, radius)


def taut_line(start: Floats, end: Floats, bones: Sequence[Solids], radius: float) -> Floats:
    """Return a line (24, 3) between two places, as short as it can be so far from the bones [mm].

    Each point goes half way to the middle of its neighbours, and out of a bone that it is too near to; near
    the ends, which lie on the bones, the tube may touch them.
    """
    share = np.linspace(0.0, 1.0, _POINTS)[:, None]
    line: Floats = (1.0 - share) * start + share * end
    room = np.minimum(radius, np.linalg.norm(line - end, axis=1))
    for _ in range(_ROUNDS):
        before = line.copy()
        line[1:-1] = 0.5 * line[1:-1] + 0.25 * (line[:-2] + line[2:])
        for bone in bones:
            low, high = bone.box
            within = np.all((line > low - radius) & (line < high + radius), axis=1)
            near = np.flatnonzero(np.asarray(within)[1:-1]) + 1
            if len(near):
                distance, outward = bone.exact(line[near])
                line[near] += np.maximum(room[near] - distance, 0.0)[:, None] * outward
        if np.abs(line - before).max() < 1e-3 * radius:
            break
    return line
