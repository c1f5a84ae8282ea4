"""Compare fibre lengths over hip flexion with those of Modenese and Kohout: P21, Fig. 15, in numbers.

Run as ``python benchmarks/paper/p21_fig15.py``. Per muscle: rest lengths beside the published ones at the
angle nearest to rest, and the lengths of our fibres when carried by LinearBlendFibres (with the published a,
and with the fitted one) against the published curves. The published rows from 10 to 18 degrees lag by 2
degrees and are left out.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vtkmuscle import Scene
from vtkmuscle.core.linear_blend import blend_fibres, fitted_a
from vtkmuscle.core.polylines import polyline_lengths
from vtkmuscle.core.rigid import apply_transform, inverse
from vtkmuscle.filters.arrays import polylines_of
from vtkmuscle.filters.surface_distance import SurfaceDistance
from vtkmuscle.io import read_motion_table
from vtkmuscle.pipelines import decompose

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from muscle_problem import data_folder

Floats = NDArray[np.float64]

PUBLISHED_A = {"gluteus_maximus": -0.042, "gluteus_medius": 0.0, "iliacus": -0.024}
#: Flexion of the scan [degrees]; the published rows nearest to it are those of 0 and 2 degrees.
REST_FLEXION = 1.576
#: Rows that are wrong in the published table [degrees].
LAGGING = (10.0, 18.0)


def spread(values: Floats) -> str:
    """Return mean, standard deviation and range of lengths as text."""
    return f"{values.mean():6.1f} mm, sd {values.std():4.1f}, {values.min():5.1f} to {values.max():5.1f}"


def main() -> None:
    """Print the comparison."""
    folder = data_folder()
    if not folder.is_dir():
        raise SystemExit(f"{folder} is not there; set VTKMUSCLE_DATA to the folder that holds lhdl_hip")
    scene = Scene.load(folder / "scene.toml")
    motion = read_motion_table(
        folder / "motions" / "hip_flexion_osim_-10_90.csv", bone="femur_r", time="hip_flexion_r"
    )
    surfaces = {name: SurfaceDistance(bone) for name, bone in scene.bones.items()}
    for name, published_a in PUBLISHED_A.items():
        table = np.genfromtxt(
            folder / "reference" / f"mk2020_fibre_length_mm_{name}_hip_flexion.csv",
            delimiter=",",
            skip_header=1,
        )
        fibres = decompose(
            scene.muscles[name].surface, scene.attachments_data(name), n_fibres=100, resolution=15
        )
        lines = polylines_of(fibres.update().output, name)
        ours = polyline_lengths(lines.points, lines.offsets)
        print(f"{name}\n  ours at rest   {spread(ours)}")
        for angle in (0.0, 2.0):
            row = table[table[:, 0] == angle][0, 1:]
            off = 100.0 * (ours.mean() / row.mean() - 1.0)
            print(f"  theirs at {angle:.0f} deg {spread(row)}; ours {off:+.1f} %")
        angles = [a for a in table[:, 0] if not LAGGING[0] <= a <= LAGGING[1] and a in set(motion.times)]
        femur = [motion.at(angle)["femur_r"] for angle in angles]
        poses = [(np.eye(4), transform) for transform in femur]

        def depth(pose: int, points: Floats, femur: list[Floats] = femur) -> Floats:
            back = apply_transform(inverse(femur[pose]), points)
            deepest: Floats = np.maximum(surfaces["pelvis"].depth(points), surfaces["femur_r"].depth(back))
            return deepest

        few = slice(None, None, max(len(poses) // 6, 1))
        chosen = list(range(len(poses)))[few]
        fitted, left = fitted_a(
            lines.points,
            lines.offsets,
            [poses[i] for i in chosen],
            lambda i, points, chosen=chosen, depth=depth: depth(chosen[i], points),
        )
        for label, a in (("published a", published_a), ("fitted a", fitted)):
            means, entered = [], []
            for i, pose in enumerate(poses):
                moved = blend_fibres(lines.points, lines.offsets, *pose, a)
                means.append(polyline_lengths(moved, lines.offsets).mean())
                if i in chosen:
                    entered.append(depth(i, moved).mean())
            theirs = np.array([table[table[:, 0] == angle][0, 1:].mean() for angle in angles])
            off = np.array(means) - theirs
            print(
                f"  {label:11s} {a:+.3f}: mean length less theirs, {angles[0]:.0f} to {angles[-1]:.0f} deg, "
                f"{off.mean():+.1f} mm, rms {np.sqrt((off**2).mean()):.1f}; mean depth in bone "
                f"{np.mean(entered):.3f} mm"
            )
        print(f"  (fitted over {len(chosen)} poses: mean depth {left:.3f} mm)")


if __name__ == "__main__":
    main()
