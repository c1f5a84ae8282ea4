"""Extremes of what the deformer is given: meshes, steps, settings, bones, units, places."""

from functools import cache

import numpy as np
import pytest
import pyvista as pv
import scenes
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from scenes import bending, figure, fixed_ends, run, tube
from slow import slow

from vtkmuscle import Scene
from vtkmuscle.core.mesh.rest_shape import RestShape
from vtkmuscle.core.mesh.surface import edge_lengths, mesh_topology, signed_volume, unique_edges
from vtkmuscle.core.motion.rigid import apply_transform, inverse, rotation_about
from vtkmuscle.core.skinning.carried_muscle import Settling
from vtkmuscle.data.arrays import points_of
from vtkmuscle.filters import BoneMotion, FixedPointDetector, PBDDeformer
from vtkmuscle.phantoms.meshing import box

VOLUME = "V/V0 - 1"
STRETCH = "longest edge, l/l0"


def volume_error(out):
    return abs(figure(out, "VolumeRatio") - 1.0)


@pytest.mark.parametrize("angle", [2, *slow(10), 45, *slow(90), 180])
def test_a_step_at_once(angle, ledger):
    for mode in scenes.MODES:
        _, out = run(tube(), bending(angle), **mode)
        if mode in scenes.STABLE:
            scenes.check_shape(tube()[0], out, 0 if angle > 90 else scenes.ITERATIONS)
        ledger.passed("Steps at once", f"{angle} degrees", VOLUME, volume_error(out))


@pytest.mark.parametrize("what", scenes.MESHES)
def test_a_mesh(what, ledger):
    mesh = scenes.MESHES[what]()
    for mode in scenes.MODES:
        _, out = run(mesh, bending(10, 20), **mode)
        if mode in scenes.STABLE and what not in scenes.NO_MUSCLES:
            scenes.check_shape(mesh[0], out)
        ledger.passed("Meshes", what, STRETCH, scenes.longest_edge(mesh[0], out))


MESH_REFUSALS = {
    "flattened to a plane": (lambda: (tube()[0] * [1, 0, 1], tube()[1]), "encloses no volume"),
    "all points in one place": (lambda: (tube()[0] * 0.0, tube()[1]), "encloses no volume"),
    "a hole": (lambda: (tube()[0], tube()[1][1:]), "the surface is open"),
    "a coordinate that is not a number": (
        lambda: (np.where(tube()[0] == tube()[0].max(), np.nan, tube()[0]), tube()[1]),
        "not finite",
    ),
    "no triangles": (lambda: (tube()[0], np.empty((0, 3), dtype=int)), "no triangles"),
}


@pytest.mark.parametrize("what", MESH_REFUSALS)
def test_a_mesh_that_cannot_be(what, ledger):
    make, message = MESH_REFUSALS[what]
    points, triangles = make()
    with pytest.raises(ValueError, match=message) as caught:
        run((points, triangles), bending(10), fixed_to=fixed_ends(tube()[0]))
    ledger.refused("Meshes", what, str(caught.value))


def examples(ledger):
    """Give a property as many examples as the form of the run wants, from its seed."""
    form = settings(max_examples=100 if ledger.long else 12, deadline=None, print_blob=True)
    return lambda test: seed(ledger.seed)(form(test))


unit = st.floats(0.0, 1.0) | st.sampled_from([0.0, 1.0, 1e-300, 1.0 - 1e-16])


def test_stiffness_and_damping(ledger):
    @examples(ledger)
    @given(unit, unit, unit, unit, st.sampled_from(scenes.PUBLISHED), st.integers(1, 30))
    def property_(stiffness, shape, volume, velocity_kept, mode, iterations):
        _, out = run(
            tube(),
            bending(15, 30),
            stiffness=stiffness,
            shape_stiffness=shape,
            volume_stiffness=volume,
            velocity_kept=velocity_kept,
            iterations=iterations,
            **mode,
        )
        ledger.passed(
            "Settings", "stiffnesses and damping, each from 0 to 1", STRETCH, figure(out, "EdgeStretchMax")
        )

    property_()


#: Angles and settings.
SETTINGS = {
    f"all stiffnesses {end:g}": (
        (20,),
        dict.fromkeys(("stiffness", "shape_stiffness", "volume_stiffness"), end),
    )
    for end in (0.0, 1.0)
} | {
    f"dt {dt:g} s with 9.8 m/s² on all points": ((5, 10), {"dt": dt, "external_force": (0.0, 5.0, -9810.0)})
    for dt in (1e-6, 1e-3, 1.0, 1e3)
}


@pytest.mark.parametrize("what", SETTINGS)
def test_settings_at_an_end(what, ledger):
    angles, keys = SETTINGS[what]
    for mode in scenes.PUBLISHED:
        _, out = run(tube(), bending(*angles), **keys, **mode)
        ledger.passed("Settings", what, STRETCH, figure(out, "EdgeStretchMax"))


def test_a_force_beyond_all_numbers(ledger):
    for mode in scenes.PUBLISHED:
        with pytest.raises(ValueError, match="smaller external_force") as caught:
            run(tube(), bending(5), dt=1000.0, external_force=(1e306, 0.0, 0.0), **mode)
        ledger.refused("Settings", "a force of 1e306 mm/s², dt 1000 s", str(caught.value))


@pytest.mark.parametrize("iterations", [1, 100, *slow(1000, 10_000)])
def test_iterations(iterations, long, ledger):
    for mode in scenes.MODES[:: 1 if long or iterations <= 100 else 4]:
        _, out = run(tube(), bending(20), **{**mode, "iterations": iterations})
        if mode in scenes.STABLE:
            scenes.check_shape(tube()[0], out, iterations)
        ledger.passed("Settings", f"iterations: {iterations}", VOLUME, volume_error(out))


#: How equal results are at another scale, of the muscle's length.
SCALE_BOUND = 1e-9


def scaled(path, factor):
    result = []
    for transforms in path:
        changed = transforms.copy()
        changed[:, :3, 3] *= factor
        result.append(changed)
    return result


def scaled_mesh(mesh, factor):
    return mesh[0] * factor, mesh[1]


@cache
def bent_by_20(number):
    """Return the points of the spindle by the mode of this number."""
    return run(tube(), bending(10, 20), **scenes.MODES[number])[0]


@pytest.mark.parametrize("exponent", [-6, -3, 3, 6])
def test_another_unit_of_length(exponent, ledger):
    factor = 10.0**exponent
    for number, mode in enumerate(scenes.MODES):
        bones = [scaled_mesh(bone, factor) for bone in scenes.BONES]
        now, _ = run(scaled_mesh(tube(), factor), scaled(bending(10, 20), factor), bones=bones, **mode)
        error = np.abs(now / factor - bent_by_20(number)).max() / 100.0
        what = f"scale 1e{exponent:+d}"
        ledger.passed("Units and positions", what, "difference / length of the muscle", error)
        assert error <= SCALE_BOUND, mode


def moved(frame, path):
    return [frame @ transforms @ inverse(frame) for transforms in path]


MOVES = {
    "an offset of 1e6 mm": np.eye(4),
    "a rigid motion of everything": rotation_about((9, -40, 7), (1, 2, 3), 130),
}
MOVES["an offset of 1e6 mm"][:3, 3] = 1e6, -1e6, 1e6
#: Voxels lie along the axes of the scene, as the published bounding box of a bone does.
QUARTER_TURN = rotation_about((9, -40, 7), (1, 0, 0), 90)
#: Side of a voxel of the bones here [mm].
VOXEL = 0.2


@pytest.mark.parametrize("what", MOVES)
def test_another_place(what, ledger):
    for number, mode in enumerate(scenes.MODES):
        turned = what.startswith("a rigid") and mode.get("collision") == "voxel"
        frame = QUARTER_TURN if turned else MOVES[what]
        bones = [(apply_transform(frame, points), triangles) for points, triangles in scenes.BONES]
        points, triangles = tube()
        now, _ = run(
            (apply_transform(frame, points), triangles),
            moved(frame, bending(10, 20)),
            bones=bones,
            fixed_to=fixed_ends(points),
            **mode,
        )
        error = np.abs(now - apply_transform(frame, bent_by_20(number))).max()
        if not turned:
            ledger.passed("Units and positions", what, "largest difference [mm]", error)
        # Rounding decides which face of a voxel stops a point that comes to an edge of it.
        assert error <= (0.05 * VOXEL if turned else 1e-6), mode


# ---------------------------------------------------------------- muscles, and spindles of their size


@pytest.mark.parametrize("iterations", [*slow(1, 3), 10, *slow(100)])
@pytest.mark.parametrize("step", [*slow(10), 45])
@pytest.mark.parametrize("triangles", [*slow(1000, 3000), 8000])
def test_a_spindle_of_a_muscle_s_size(triangles, step, iterations, ledger):
    """8000 triangles are solved on two levels."""
    around = round((triangles / 4) ** 0.5)
    mesh = tube(rings=triangles // (2 * around), around=around)
    _, out = run(mesh, bending(*range(step, 91, step)), iterations=iterations)
    scenes.check_shape(mesh[0], out, iterations)
    ledger.passed(
        "Muscles", f"a spindle of {triangles} triangles, 90 degrees", STRETCH, figure(out, "EdgeStretchMax")
    )


@pytest.mark.realdata
@pytest.mark.parametrize("iterations", [*slow(1), 10])
@pytest.mark.parametrize("step", [*slow(10), 45])
@pytest.mark.parametrize("triangles", [1000, *slow(3000)])
@pytest.mark.parametrize("name", ["gluteus_maximus", "gluteus_medius", "iliacus", "adductor_brevis"])
def test_a_muscle_of_the_hip(lhdl_hip, name, triangles, step, iterations, ledger):
    scene = Scene.load(lhdl_hip / "scene_lite.toml")
    bones, areas = scene.bones_data(), scene.attachments_data(name)
    surface = pv.read(lhdl_hip / "muscles_lite" / f"{name}_{triangles}.vtp")
    motion = scene.motion.part(np.unique(np.append(np.arange(0, 45, step // 2), 45)))
    deformer = PBDDeformer(
        muscle=FixedPointDetector().apply(surface, bones, areas),
        rest_bones=bones,
        bones=BoneMotion(bones=bones, motion=motion),
        iterations=iterations,
        measure_shape=True,
        measure_penetration=True,
    )
    for time in motion.times[1:]:
        out = deformer.update(float(time)).output
        scenes.check_shape(points_of(surface), out, iterations)
        ledger.passed("Muscles", f"{name}, {triangles} triangles", STRETCH, figure(out, "EdgeStretchMax"))


# ---------------------------------------------------------------- states that no motion leads to


def settled_from(positions):
    """Return V / V0 of a muscle that is carried to positions that no muscle has."""
    points, triangles = tube()
    fixed_to = fixed_ends(points).astype(np.int64)
    settling = Settling(RestShape(points, mesh_topology(len(points), triangles)), fixed_to, {})
    carried = positions(points, fixed_to < 0)
    surface = settling.settle(carried, np.array([np.eye(4)] * 2), rounds=5).surface
    assert np.isfinite(surface).all()
    return signed_volume(surface, triangles) / signed_volume(points, triangles)


def test_random_positions_recover_the_volume(ledger):
    @examples(ledger)
    @given(st.integers(0, 2**32 - 1), st.sampled_from([1.0, 50.0, 1000.0]))
    def property_(seed, spread):
        def anywhere(rest, free):
            positions = rest.copy()
            positions[free] = np.random.default_rng(seed).normal(scale=spread, size=(free.sum(), 3))
            return positions

        ratio = settled_from(anywhere)
        ledger.passed("States", "carried to random positions", VOLUME, abs(ratio - 1.0))
        assert ratio == pytest.approx(1.0, abs=1e-9)

    property_()


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_wholly_flattened(axis, ledger):
    ratio = settled_from(lambda rest, free: rest * (np.arange(3) != axis))
    ledger.passed("States", "carried to a plane", VOLUME, abs(ratio - 1.0))
    assert ratio == pytest.approx(1.0, abs=1e-9)


# ---------------------------------------------------------------- fixed points and bones


def test_all_points_fixed(ledger):
    points, triangles = tube()
    for mode in scenes.MODES:
        now, _ = run((points, triangles), bending(40), fixed_to=np.ones(len(points)), **mode)
        error = np.abs(now - apply_transform(bending(40)[-1][1], points)).max()
        ledger.passed("Fixed points and bones", "all points fixed", "off their bone [mm]", error)
        assert error <= 1e-9


def test_no_point_fixed(ledger):
    points, triangles = tube()
    free = np.full(len(points), -1)
    with pytest.raises(ValueError, match="no point is fixed") as caught:
        run((points, triangles), bending(10), fixed_to=free)
    ledger.refused("Fixed points and bones", "no point fixed", str(caught.value))
    for mode in scenes.PUBLISHED:
        _, out = run(
            (points, triangles), bending(10, 20), fixed_to=free, external_force=(0, 3.0, -9.0), **mode
        )
        ledger.passed(
            "Fixed points and bones", "no point fixed, a force", STRETCH, figure(out, "EdgeStretchMax")
        )


def test_no_bones(ledger):
    points, triangles = tube()
    with pytest.raises((ValueError, RuntimeError)) as caught:
        run((points, triangles), [np.empty((0, 4, 4))] * 2, bones=[], fixed_to=np.full(len(points), -1))
    ledger.refused("Fixed points and bones", "no bones", str(caught.value))


@pytest.mark.parametrize("mode", scenes.MODES, ids=str)
def test_fifty_bones(mode, ledger):
    more = [box((22 * k - 550, 60, -5), (22 * k - 535, 80, 5), 100.0) for k in range(48)]
    path = [np.concatenate([transforms, [np.eye(4)] * 48]) for transforms in bending(10, 20)]
    _, out = run(tube(), path, bones=[*scenes.BONES, *more], **mode)
    ledger.passed("Fixed points and bones", "50 bones", VOLUME, volume_error(out))


def test_a_bone_inside_the_muscle(ledger):
    inside = box((-2, -2, -10), (2, 2, 10), 100.0)
    for mode in scenes.MODES:
        path = [np.concatenate([transforms, [np.eye(4)]]) for transforms in bending(10, 20)]
        _, out = run(tube(), path, bones=[*scenes.BONES, inside], **mode)
        ledger.passed(
            "Fixed points and bones", "a bone inside the muscle", STRETCH, figure(out, "EdgeStretchMax")
        )


# ---------------------------------------------------------------- sizes


@pytest.mark.parametrize("triangles", [1_000, 30_000, 1_000_000])
def test_sizes(triangles, long, ledger):
    if triangles > 1_000 and not long:
        pytest.skip("in the long form")
    around = round((triangles / 8) ** 0.5)
    mesh = tube(rings=triangles // (2 * around), around=around)
    settings_ = [mode for mode in scenes.MODES if triangles < 1e6 or mode.get("collision") != "voxel"]
    for mode in settings_[:: 1 if triangles <= 1_000 else 4]:
        now, out = run(mesh, bending(2), **{**mode, "iterations": 5})
        ledger.passed("Sizes", f"{len(mesh[1]):,} triangles".replace(",", " "), VOLUME, volume_error(out))
        assert edge_lengths(now, unique_edges(mesh[1])).max() < 100.0
