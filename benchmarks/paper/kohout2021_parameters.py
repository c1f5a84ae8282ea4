"""Kohout and Červenka 2021, Algorithm 2: what each parameter of PBDDeformer does that departs from it.

Worst over adductor brevis and iliacus, which are the hardest, and over flexion from 0 to 90 degrees, looked
at every 10, stepped by 2; 10 iterations. A row changes one parameter of the stable defaults to what is
published, or away from it; the first and the last are both whole. A folded edge is bent by more than 149
degrees, and was by less than 126 at rest. How far points are from those of the stable defaults is a root mean
square over a muscle at 90 degrees. Steps are those of the adductor brevis, in plain iterations, as in
kohout2021_times.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from common import LEFT, PRINTED, STABLE, Case, Chain, Table, angles_up_to, main, rms, value

from vtkmuscle.core.mesh.rest_shape import dihedral_angles
from vtkmuscle.core.mesh.surface import mesh_topology
from vtkmuscle.data.arrays import checked_surface, points_of

ITERATIONS = 10
#: Of a folded edge, and of the same at rest [degrees].
FOLDED, UNFOLDED = 149.0, 126.0
WITHOUT_FIBRES = "no fibres"
#: A title, the model, settings of its deformer; what the paper has is marked with a star.
VARIANTS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("stable defaults", STABLE, {}),
    ("prediction velocity *", STABLE, {"prediction": "velocity"}),
    ("signed_angles False *", STABLE, {"signed_angles": False}),
    ("order kind *", STABLE, {"order": "kind"}),
    ("finish False *", STABLE, {"finish": False}),
    ("solved_triangles 0 *", STABLE, {"solved_triangles": 0}),
    ("collision voxel *", STABLE, {"collision": "voxel"}),
    ("bone_clearance 1 mm", STABLE, {"bone_clearance": 1.0}),
    (f"{WITHOUT_FIBRES}, anisotropy always", STABLE, {}),
    (f"{WITHOUT_FIBRES}, anisotropy fibres *", STABLE, {"anisotropy": "fibres"}),
    (f"as printed, {WITHOUT_FIBRES} *", PRINTED, {}),
    ("as printed, but prediction bones", PRINTED, {"prediction": "bones"}),
    ("as printed *", PRINTED, {}),
)


def chain_of(case: Case, name: str, number: int, **more: Any) -> Chain:
    """Return a muscle by a variant."""
    title, model, settings = VARIANTS[number]
    chain = case.chain(name, model, iterations=ITERATIONS, **settings, **more)
    if WITHOUT_FIBRES in title:
        chain.deformer.fibres = None
    return chain


def worst(chain: Chain, angles: list[float]) -> tuple[list[float], Any]:
    """Return worst volume, edge, angles, folds and depth over a motion, and the muscle at its end or None."""
    rest, triangles = checked_surface(chain.fixed, "muscle")
    quads = mesh_topology(len(rest), triangles).quads
    unfolded = np.abs(dihedral_angles(rest, quads)[0]) < np.radians(UNFOLDED)
    most, muscle = np.zeros(5), None
    for angle in angles[1:]:
        pose = chain.pose(angle)
        muscle = None if pose is None else pose[1]
        if muscle is None:
            break
        bent = np.abs(dihedral_angles(points_of(muscle), quads)[0])
        names = ("EdgeStretchMax", "DihedralErrorP95", "PenetrationMax")
        stretch, turned, depth = (value(muscle, name) for name in names)
        folds = float((unfolded & (bent > np.radians(FOLDED))).sum())
        off = 100.0 * abs(value(muscle, "VolumeRatio") - 1.0)
        most = np.maximum(most, [off, stretch, turned, folds, depth])
    return list(most), muscle


def tables(case: Case) -> list[Table]:
    """Return what each does."""
    columns = ("settings; * is published", "volume [%]", "longest edge", "angles, p95 of change [deg]")
    columns += ("folded edges", "in bone [mm]", "from stable, rms [mm]", "step [plain iterations]")
    table = Table("Departures from Algorithm 2, worst over two muscles, 0 to 90 degrees", columns)
    angles = angles_up_to(4.0 if case.short else 90.0)
    looked_at = [0.0, *angles[5::5]] if len(angles) > 5 else angles
    muscles = case.muscles[1:3]
    stable: dict[str, Any] = {}
    for number, (title, _, _) in enumerate(VARIANTS):
        most, apart, lost = np.zeros(5), 0.0, []
        for name in muscles:
            chain = chain_of(case, name, number, measure_shape=True, measure_penetration=True)
            of_muscle, muscle = worst(chain, looked_at)
            most = np.maximum(most, of_muscle)
            if muscle is None:
                lost.append(name)
                continue
            apart = max(apart, rms(muscle, stable.setdefault(name, muscle)))
        step = chain_of(case, case.adductor, number).step_time(angles[:10])[1]
        off, stretch, turned, folds, depth = most
        mm = case.scene.millimetres
        table.add(
            title + "".join(f"; {name} {LEFT}" for name in lost),
            f"{off:.1e}",
            f"{stretch:.3g}",
            f"{turned:.1f}",
            f"{folds:.0f}",
            f"{depth * mm:.2f}",
            f"{apart * mm:.3g}",
            "" if np.isnan(step) else f"{step:.2g}",
        )
    return [table]


if __name__ == "__main__":
    main(__doc__, tables)
