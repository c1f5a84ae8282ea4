"""The same scene, written down otherwise, gets the same verdicts for the same reasons."""

import warnings
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import pyvista
from phantoms import fibre_block
from scipy.spatial.transform import Rotation
from slow import slow
from vtkmodules.vtkFiltersModeling import vtkLinearSubdivisionFilter

from vtkmuscle import Scene, phantoms
from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.template import KINDS
from vtkmuscle.data.arrays import points_of, polylines_of, surface_from, triangles_of, with_points
from vtkmuscle.io.surfaces import read_surface
from vtkmuscle.pipelines import decompose
from vtkmuscle.scene.checks import turned_over


def spindle(**muscle):
    scene = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8)
    scene = replace(scene, motion=scene.motion.part(range(0, 21, 2)))
    return replace(scene, muscles={"spindle": replace(scene.muscles["spindle"], **muscle)})


def with_motion(change):
    scene = spindle()
    ((bone, table),) = scene.motion.transforms.items()
    return replace(scene, motion=change(scene.motion, bone, table))


def off_centre(motion, bone, table):
    """The bone turns about a point 60 mm beside its joint."""
    shift = np.eye(4)
    shift[:3, 3] = [0.0, 60.0, 0.0]
    moved = shift @ table @ np.linalg.inv(shift)
    return RigidMotion(motion.times, {bone: moved}, motion.centre_of(bone))


def in_radians(motion, bone, table):
    column = Coordinate(np.radians(motion.times), "deg")
    return RigidMotion(motion.times, {bone: table}, motion.centre_of(bone), {"angle": column})


def about_another_axis(motion, bone, table):
    """The bone turns about an axis 40 degrees off the axis of the coordinate's twists."""
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_euler("xyz", [40.0, 40.0, 40.0], degrees=True).as_matrix()
    return replace(motion, transforms={bone: turn @ table @ turn.T})


def with_a_gap(motion, bone, table):
    motion = replace(motion, coordinates={}).part([0, 1, 2, 3, 9, 10])
    return replace(motion, transforms={bone: np.delete(table, slice(4, 9), axis=0)})


def named(motion, bone, table):
    """The spindle as a hamstring that extends the knee."""
    old = next(iter(motion.coordinates.values()))
    turned = {name: -twists for name, twists in old.twists.items()}
    return replace(motion, coordinates={"knee_flexion": Coordinate(-old.values, "deg", "flexion", turned)})


def guessed(scene):
    (muscle,) = scene.muscles.values()
    origin, insertion = muscle.attachments
    areas = replace(origin, estimated=True, confidence=0.1), insertion
    return replace(scene, muscles={"spindle": replace(muscle, attachments=areas)})


SCENES = {
    "good": (spindle, "ok", set()),
    "centre off": (lambda: with_motion(off_centre), "look", {"plausible", "short fibres"}),
    "radians": (lambda: with_motion(in_radians), "look", {"plausible", "arm and length"}),
    "other axis": (lambda: with_motion(about_another_axis), "look", {"arm and slope"}),
    "missing frames": (lambda: with_motion(with_a_gap), "look", {"plausible"}),
    "wrong sign": (
        lambda: replace(
            with_motion(named),
            muscles={"spindle": replace(spindle().muscles["spindle"], muscle="semimembranosus")},
        ),
        "look",
        {"published arms"},
    ),
    "long fascicles": (
        lambda: spindle(hill={"tendon_slack_length": 5.0}, muscle="semimembranosus"),
        "look",
        {"fascicles"},
    ),
    "guessed": (lambda: guessed(spindle()), "look", {"plausible"}),
    "tendon too long": (lambda: spindle(hill={"tendon_slack_length": 1e4}), "look", {"hill"}),
}


def mapped(scene, *, scale=1.0, turn=None, shift=(0.0, 0.0, 0.0), mirror=False, units="mm"):
    """Return a scene whose points x are at scale * turn x + shift, mirrored in x first."""
    linear = np.eye(3) if turn is None else Rotation.from_rotvec(turn).as_matrix()
    linear = linear @ np.diag([-1.0 if mirror else 1.0, 1.0, 1.0])
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = scale * linear, shift

    def points(old):
        return old @ whole[:3, :3].T + whole[:3, 3]

    def surface(old):
        new = with_points(old, points(points_of(old)))
        return turned_over(new) if mirror else new

    def twist(old):
        angular = np.linalg.det(linear) * old[:, 3:] @ linear.T
        return np.column_stack([scale * old[:, :3] @ linear.T + np.cross(whole[:3, 3], angular), angular])

    def muscle(old):
        areas = tuple(replace(area, landmarks=points(area.landmarks)) for area in old.attachments)
        hill = {name: scale * value for name, value in old.hill.items()}
        return replace(old, surface=surface(old.surface), attachments=areas, hill=hill)

    motion = scene.motion
    coordinates = {
        name: replace(q, twists=q.twists and {bone: twist(old) for bone, old in q.twists.items()})
        for name, q in motion.coordinates.items()
    }
    transforms = {bone: whole @ table @ np.linalg.inv(whole) for bone, table in motion.transforms.items()}
    centre = {bone: points(motion.centre_of(bone)) for bone in motion.transforms}
    return replace(
        scene,
        units=units,
        bones={name: surface(bone) for name, bone in scene.bones.items()},
        muscles={name: muscle(old) for name, old in scene.muscles.items()},
        motion=RigidMotion(motion.times, transforms, centre, coordinates),
    )


def over_surfaces(change, scene):
    """Return a scene with other surfaces of the same shapes."""
    return replace(
        scene,
        bones={name: change(bone) for name, bone in scene.bones.items()},
        muscles={name: replace(old, surface=change(old.surface)) for name, old in scene.muscles.items()},
    )


def shuffled(surface):
    points, triangles = points_of(surface), triangles_of(surface, "surface")
    order = np.random.default_rng(2).permutation(len(points))
    return surface_from(points[order], np.argsort(order)[triangles][::-1])


def subdivided(surface):
    finer = vtkLinearSubdivisionFilter()
    finer.SetNumberOfSubdivisions(1)
    finer.SetInputData(surface)
    finer.Update()
    return with_points(finer.GetOutput(), points_of(finer.GetOutput()))


def reordered(scene):
    return replace(scene, bones=dict(reversed(scene.bones.items())))


TRANSFORMATIONS = {
    "a thirtieth": partial(mapped, scale=1 / 30),
    "thirty times": partial(mapped, scale=30.0),
    "shifted": partial(mapped, shift=(310.0, -1700.0, 45.0)),
    "turned": partial(mapped, turn=(0.4, 0.3, -0.7)),
    "mirrored": partial(mapped, mirror=True),
    "all at once": partial(mapped, scale=0.2, turn=(0.1, -0.5, 0.2), shift=(9.0, 90.0, 300.0), mirror=True),
    "in centimetres": partial(mapped, scale=0.1, units="cm"),
    "in metres": partial(mapped, scale=0.001, units="m"),
    "other order of points": partial(over_surfaces, shuffled),
    "finer triangles": partial(over_surfaces, subdivided),
    "other order of bones": reordered,
}
#: The transformation that is tried by default.
QUICK = "all at once"


def judged(scene, deformer="none"):
    """Return the verdict on each muscle, and the checks behind it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = replace(scene, deformer=deformer).run(figures=False, report=False)
    verdicts = {name: result.report["muscles"][name]["verdict"] for name in scene.muscles}
    return {
        name: (one["verdict"], {why["check"] for why in one["reasons"]}) for name, one in verdicts.items()
    }


@pytest.mark.parametrize("name", SCENES)
def test_each_fault_has_its_reason(name):
    make, verdict, checks = SCENES[name]
    assert judged(make()) == {"spindle": (verdict, checks)}


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("how", [QUICK, *slow(*(how for how in TRANSFORMATIONS if how != QUICK))])
def test_the_same_scene_written_otherwise_has_the_same_reasons(name, how):
    make, verdict, checks = SCENES[name]
    assert judged(TRANSFORMATIONS[how](make())) == {"spindle": (verdict, checks)}


def rings_from_elsewhere(scene):
    def area(old):
        return replace(
            old, landmarks=np.roll(old.landmarks, 3, axis=0) if old.closed else old.landmarks[::-1]
        )

    muscles = {
        name: replace(old, attachments=tuple(map(area, reversed(old.attachments))))
        for name, old in scene.muscles.items()
    }
    return replace(scene, muscles=muscles)


@pytest.mark.filterwarnings("ignore:SliceMorpher")
@pytest.mark.parametrize("how", [QUICK, "mirrored", "other order of points", "rings from elsewhere"])
@pytest.mark.parametrize("settings", [{}, {"course": "straight"}, *({"template": kind} for kind in KINDS)])
def test_fibres_are_those_of_the_same_muscle_written_otherwise(settings, how):
    scene = Scene.from_phantom(phantoms.hip(), n_fibres=20)
    other = (TRANSFORMATIONS | {"rings from elsewhere": rings_from_elsewhere})[how](scene)
    for name in scene.muscles:
        made = [
            decompose(one.muscles[name].surface, one.attachments_data(name), n_fibres=20, **settings).output
            for one in (scene, other)
        ]
        here, there = (polylines_of(fibres, "fibres").lengths for fibres in made)
        assert np.allclose(there, (0.2 if how == QUICK else 1.0) * here, rtol=1e-4), name


@pytest.mark.parametrize("name", ["block", "iliacus", *slow("gluteus_medius")])
def test_a_scene_moved_rigidly_deforms_as_before(name):
    """By position based dynamics. In a block straight fibres, samples and walls are side by side."""
    phantom = fibre_block("parallel") if name == "block" else phantoms.hip()
    scene = Scene.from_phantom(phantom, n_fibres=20).with_muscles(name)
    scene = scene.with_settings(deformer="pbd", iterations=5)
    turn, shift = (0.5, 1.1, -0.3), (250.0, -1300.0, 75.0)
    runs = [one.run(frames="0:6", figures=False) for one in (scene, mapped(scene, turn=turn, shift=shift))]
    for kind in ("muscle", "fibres"):
        here, there = (points_of(getattr(run, kind)(name, frame=5)) for run in runs)
        np.testing.assert_allclose(Rotation.from_rotvec(turn).apply(here) + shift, there, rtol=0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["good", "wrong sign"])
@pytest.mark.parametrize("how", TRANSFORMATIONS)
def test_a_deformed_muscle_written_otherwise_has_the_same_reasons(name, how):
    make, verdict, checks = SCENES[name]
    assert judged(TRANSFORMATIONS[how](make()), "paths") == {"spindle": (verdict, checks)}


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj"])
def test_another_file_format_has_the_same_reasons(suffix, tmp_path):
    make, verdict, checks = SCENES["wrong sign"]
    path = make().save(tmp_path)
    text = path.read_text()
    for file in (*tmp_path.glob("bones/*.vtp"), *tmp_path.glob("muscles/*.vtp")):
        pyvista.wrap(read_surface(file)).save(file.with_suffix(suffix))
        text = text.replace(file.relative_to(tmp_path).as_posix(), f"{file.parent.name}/{file.stem}{suffix}")
    path.write_text(text)
    assert judged(Scene.load(path)) == {"spindle": (verdict, checks)}
