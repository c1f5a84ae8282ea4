"""Measure what each constant of the paths decides, by half and by double.

Run as ``python benchmarks/path_constants.py [--write FILE]``. For each, the largest errors of the moment arm
on the phantoms of ``how_right.py`` (their mean, and the worst phantom), and the largest change of the mean
arm of each muscle of the real hip in flexion, every 10 degrees; without that data, the phantoms alone.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from how_right import N_FIBRES, Measured, Table, known_phantoms, measured
from real_hip import data_folder

from vtkmuscle import Scene
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.paths import bone_contact, neighbours, pose, surroundings

#: Modules that know a constant, its name, and what it is.
CONSTANTS = (
    ((neighbours,), "MODULUS", "modulus across the paths"),
    ((neighbours,), "SHEAR_MODULUS", "shear modulus along the paths"),
    ((surroundings,), "MODULUS", "lateral modulus of the tissue at a bone"),
    ((surroundings,), "LEAST_LAYER", "least thickness of the lateral tissue"),
    ((surroundings,), "LEAST_ACROSS", "least sine of a bone's normal across the fibre"),
    ((surroundings,), "BUNDLE", "width of a bowed bundle"),
    ((surroundings,), "THICKNESS_SMOOTHING", "smoothing of the offset from a bone"),
    ((bone_contact, pose), "PUSH", "stiffness of bones"),
    ((bone_contact,), "ROUNDING", "rounding of bone contact"),
)
#: Frames of the hip between two that are looked at.
EVERY = 5


@contextmanager
def scaled(modules: tuple[object, ...], name: str, factor: float) -> Iterator[None]:
    """Let a constant have a multiple of its value."""
    before = getattr(modules[0], name)
    try:
        for module in modules:
            setattr(module, name, factor * before)
        yield
    finally:
        for module in modules:
            setattr(module, name, before)


def errors() -> list[float]:
    """Return the largest error of the paths on each phantom [mm]."""
    found = []
    for case in known_phantoms():
        ((name, muscle),) = case.phantom.muscles.items()
        given = muscle, case.phantom.bones, case.phantom.attachments[name], case.motion
        off = case.means(measured(*given, n_fibres=N_FIBRES))["paths"] - case.answers
        found.append(float(np.abs(off).max()))
    return found


def hip_arms(folder: Path) -> dict[str, np.ndarray]:
    """Return the mean moment arms of the muscles of the hip, by name [mm]."""
    scene = Scene.load(folder / "scene.toml")
    motion = scene.motion
    few = RigidMotion(
        motion.times[::EVERY],
        {bone: transforms[::EVERY] for bone, transforms in motion.transforms.items()},
        motion.centre,
    )
    arms = {}
    for name, muscle in scene.muscles.items():
        found: Measured = measured(
            muscle.surface, scene.bones_data(), scene.attachments_data(name), few, **(muscle.fibres or {})
        )
        slopes = -np.gradient(found.lengths["paths"].mean(axis=1), np.radians(few.times), edge_order=2)
        arms[name] = slopes
    return arms


def main() -> None:
    """Print the table, and write it where asked to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", type=Path, metavar="FILE", help="write it there as CSV")
    asked = parser.parse_args()
    hip = data_folder()
    muscles = hip_arms(hip) if hip.is_dir() else {}
    known = errors()
    header = ("constant", "value", "times", "mean [mm]", "worst [mm]", *(f"{name} [mm]" for name in muscles))
    table = Table(asked.write.stem if asked.write else "constants", header, [])
    table.rows.append(
        ("defaults", "", "1", f"{np.mean(known):.2f}", f"{max(known):.1f}", *[""] * len(muscles))
    )
    for modules, name, what in CONSTANTS:
        value = getattr(modules[0], name)
        for factor in (0.5, 2.0):
            print(f"{what}, {factor:g} times ...", file=sys.stderr, flush=True)
            with scaled(modules, name, factor):
                known = errors()
                arms = hip_arms(hip) if muscles else {}
            changes = [f"{np.abs(arms[one] - muscles[one]).max():.1f}" for one in muscles]
            table.rows.append(
                (what, f"{value:.3g}", f"{factor:g}", f"{np.mean(known):.2f}", f"{max(known):.1f}", *changes)
            )
    print(table.text())
    if asked.write:
        table.write(asked.write.parent)


if __name__ == "__main__":
    main()
