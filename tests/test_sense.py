"""Implausible scenes are reported, as an error where it is certain, else as a warning; others are not."""

import inspect
import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_metamorphic import mapped
from tiny_scene import ellipsoid, write_tiny_scene

from vtkmuscle import Scene, SceneError, phantoms
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion, hinge
from vtkmuscle.data.arrays import checked_surface, points_of, surface_from, with_points
from vtkmuscle.io import read_landmarks
from vtkmuscle.scene.sense import check_sense

PAGE = Path(__file__).parents[1] / "docs/reference/sense.rst"


@pytest.fixture(scope="module")
def good():
    return Scene.from_phantom(phantoms.hip(detail=0.5))


def areas(scene, change):
    """Return a scene whose first muscle has other areas."""
    name, muscle = next(iter(scene.muscles.items()))
    return replace(
        scene, muscles={name: replace(muscle, attachments=tuple(change(list(muscle.attachments))))}
    )


def landmarks(scene, change):
    """Return a scene whose first muscle has other landmarks of its origin."""
    return areas(scene, lambda old: [replace(old[0], landmarks=change(old[0].landmarks)), *old[1:]])


def bones(scene, **changes):
    return replace(scene, bones={**scene.bones, **changes})


def moved(surface, change):
    return with_points(surface, change(points_of(surface).copy()))


def bone(name, change):
    """Return what makes a scene with other points of a bone."""
    return lambda scene: bones(scene, **{name: moved(scene.bones[name], change)})


def one_point(value):
    def change(points):
        points[7] = value
        return points

    return change


def translated(scene, ways, **column):
    poses, times = np.tile(np.eye(4), (len(ways), 1, 1)), np.arange(len(ways), dtype=float)
    poses[:, 0, 3] = ways
    coordinates = {name: Coordinate(values, "mm") for name, values in column.items()}
    return replace(scene, motion=RigidMotion(times, {"femur": poses}, None, coordinates))


def shuffled(points):
    return np.random.default_rng(1).permutation(points)


def sheet():
    return surface_from(np.array([[0.0, 0, 0], [50, 0, 0], [50, 50, 0], [0, 50, 0]]), [[0, 1, 2], [0, 2, 3]])


#: What is tried: a name, how the scene is made, whether it is an error, and what is said.
def unsure(scene):
    """Return a scene whose first muscle has an origin that was estimated, and may be on another bone."""
    return areas(scene, lambda old: [replace(old[0], estimated=True, confidence=0.04), *old[1:]])


def sunken(scene):
    """Return a scene whose first muscle lies 6 mm deeper in the pelvis than before."""
    name, muscle = next(iter(scene.muscles.items()))
    points = points_of(muscle.surface)
    distance, outward = solids_of(*checked_surface(scene.bones["pelvis"], "pelvis")).exact(points)
    deepest = int(np.argmin(distance))
    way = -(6.0 + distance[deepest]) * outward[deepest]
    return replace(scene, muscles={name: replace(muscle, surface=with_points(muscle.surface, points + way))})


def pierced(scene):
    """Return a scene with a thin bone along the middle of its first muscle."""
    points = points_of(next(iter(scene.muscles.values())).surface)
    along = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    rod = points_of(ellipsoid((40.0, 1.5, 1.5), (0, 0, 0))) @ along + points.mean(axis=0)
    return bones(scene, rod=with_points(ellipsoid((40.0, 1.5, 1.5), (0, 0, 0)), rod))


def hinged(scene, centre=(0.0, 0.0, 0.0), axis=(-1.0, 0.0, 0.0), angles=range(0, 31, 5), **column):
    """Return a scene whose femur turns about an axis, flexing; ``column`` is a coordinate beside it."""
    motion = hinge("femur", centre, axis, np.array(angles, dtype=float))
    coordinates = {name: Coordinate(values, "deg") for name, values in column.items()}
    times = np.arange(len(motion.times), dtype=float)
    return replace(scene, motion=RigidMotion(times, motion.transforms, centre, coordinates))


def twofold(scene):
    """Return a scene with the first muscle twice, in contact."""
    name, muscle = next(iter(scene.muscles.items()))
    return replace(scene, muscles={name: muscle, "again": muscle}, muscle_contact="on")


# fmt: off
NONSENSE = {
    "coordinate in another unit": (
        lambda s: hinged(s, flexion=np.radians(range(0, 31, 5))), False,
        r"the bones turn by 57\.3 degrees per degree of the coordinate",
    ),
    "translation in another unit": (
        lambda s: translated(s, [0, 1, 2], slide=[0.0, 1e-3, 2e-3]), False,
        r"the bones move by 1e\+03 mm per mm of the coordinate",
    ),
    "coordinate of another motion": (
        lambda s: hinged(s, angles=[0, 5, 10, 15], flexion=[0.0, 50.0, 13.0, 80.0]), False,
        "degrees per degree of the coordinate",
    ),
    "coordinate with the wrong sign": (
        lambda s: hinged(s, flexion=-np.arange(0.0, 31.0, 5.0)), False,
        "its sign is not of flexion: by the coordinate 'femur' extends in LPS",
    ),
    "angles in radians": (
        lambda s: replace(s, motion=hinge("femur", (0, 0, 0), (-1, 0, 0), np.arange(0.0, 1.6, 0.2))), False,
        "write angles in degrees, not radians",
    ),
    "joint with a wrong centre": (
        lambda s: hinged(s, centre=(0.0, 60.0, 80.0)), False,
        r"the bones 'pelvis' and 'femur' are \d+(\.\d+)? mm (deeper in each other|farther apart)",
    ),
    "joint beside the head": (
        lambda s: hinged(s, centre=(0.0, 6.0, 5.0)), False,
        r"'femur' turns about an axis 7\.\d* mm from the centre of its head, a sphere with a radius of 2[34]",
    ),
    "frames missing from the motion": (
        lambda s: hinged(s, angles=[0, 2, 4, 6, 26, 28, 30, 32]), False,
        r"the bones jump from frame 3 to frame 4, by 20 degrees: the step is 9\.\d times as large",
    ),
    "two bones in one position": (
        lambda s: replace(s, bones={**s.bones, "thigh": s.bones["femur"]}), False, "lies in the bone 'thigh'",
    ),
    "two muscles in one position": (twofold, False, r"100% of the muscle lies in the muscle 'again'"),
    "guess of a joint that is not sure": (
        lambda s: replace(s, guessed={"joints.hip.centre": 0.3, "units": 0.9}), False,
        r"guessed\.joints\.hip\.centre: is a guess with low confidence \(0\.30\)",
    ),
    "bone through a muscle": (
        pierced, False,
        r"the bone 'rod' is up to \d+(\.\d+)? mm deep in the muscle, at \(",
    ),
    "estimate that is not sure": (unsure, False, r"estimated on .* with low confidence \(0.04\)"),
    "muscle deep in a bone": (
        sunken, False,
        r"up to [56]\.\d* mm deep in the bone 'pelvis', at \(.*\), with \d+% of the points",
    ),
    "origin and insertion exchanged": (
        lambda s: areas(s, lambda a: [replace(a[0], bone=a[1].bone), replace(a[1], bone=a[0].bone)]), True,
        "origin and insertion are exchanged",
    ),
    "origin on the insertion's bone": (
        lambda s: areas(s, lambda a: [replace(a[0], bone=a[1].bone), *a[1:]]), False,
        "but 0",
    ),
    "landmarks beside the bone": (
        lambda s: landmarks(s, lambda x: np.add(x, [0, 0, 60])), False,
        "from their bone",
    ),
    "landmarks beside the muscle": (
        lambda s: areas(s, lambda a: [replace(x, landmarks=x.landmarks + np.array([0, 40, 0])) for x in a]),
        False,
        "from their muscle",
    ),
    "bones 10 m away": (
        lambda s: replace(s, bones={n: moved(b, lambda x: x + 1e4) for n, b in s.bones.items()}), True,
        "from their bone",
    ),
    "ring in random order": (lambda s: landmarks(s, shuffled), True, "not in the order of the boundary"),
    "two landmarks exchanged": (
        lambda s: landmarks(s, lambda x: x[[0, 4, 2, 3, 1, *range(5, len(x))]]), False,
        "not in the order of the boundary",
    ),
    "all landmarks equal": (lambda s: landmarks(s, lambda x: x[:1].repeat(9, 0)), True, "landmarks coincide"),
    "metres given as millimetres": (lambda s: scaled(s, 1e-3), False, 'files are in m, write units = "m"'),
    "millimetres given as metres": (
        lambda s: replace(s, units="m"), True,
        'files are in mm, write units = "mm"',
    ),
    "bone in another unit": (bone("femur", lambda x: 1e-3 * x), True, "scale all files to one unit"),
    "bone without an inside": (lambda s: bones(s, plate=sheet()), False, "muscles will pass through"),
    "bone of one triangle": (
        lambda s: bones(s, chip=surface_from(np.eye(3) * 30, [[0, 1, 2]])), False,
        "muscles will pass through",
    ),
    "coordinate of 1e12": (bone("pelvis", one_point(1e12)), True, "remove stray points"),
    "coordinate of 1e300": (bone("pelvis", one_point(1e300)), True, r"has a coordinate of 1e\+300"),
    "coordinate with a digit too many": (bone("pelvis", one_point(8000.0)), False, "remove stray points"),
    "scene 1e15 mm from the origin": (bone("pelvis", lambda x: x + 1e15), True, "too far for its shape"),
    "all areas on one bone": (
        lambda s: areas(s, lambda a: [replace(one, bone="pelvis") for one in a]), False,
        "will move with the bone, undeformed",
    ),
    "motion of 1e15 mm": (
        lambda s: translated(s, [0, 1e15]), True,
        "farther apart than at rest; .* unit and order of the transforms",
    ),
    "starts 3 m away": (lambda s: translated(s, [3000, 3001]), True, "farther apart than at rest"),
    "motion in another unit": (lambda s: translated(s, [0, 1, 300]), False, "farther apart than at rest"),
}
# fmt: on


def scaled(scene, factor):
    """Return a scene whose files are in another unit than it says."""
    return mapped(scene, scale=factor)


def said(scene):
    """Return the error that a scene ends with, or None, and its warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            check_sense(scene)
        except SceneError as error:
            return str(error), []
    return None, [str(warning.message) for warning in caught]


@pytest.mark.parametrize("name", NONSENSE)
def test_nonsense_is_said(good, name):
    make, sure, words = NONSENSE[name]
    try:
        error, warned = said(make(good))
    except SceneError as refused:  # as it is read
        error, warned = str(refused), []
    assert (error is not None) is sure, (error, warned)
    found = [error] if sure else warned
    assert any(re.search(words, message) for message in found), found
    assert all(len(message.splitlines()) == 1 and "; " in message for message in found)


PHANTOMS = [name for name in phantoms.__all__ if inspect.isfunction(getattr(phantoms, name))]


@pytest.mark.parametrize("name", sorted(set(PHANTOMS) - {"fibre_block"}))
def test_of_what_can_be_meant_nothing_is_said(name):
    assert said(Scene.from_phantom(getattr(phantoms, name)())) == (None, [])


@pytest.mark.parametrize(("units", "factor"), [("cm", 0.1), ("m", 0.001)])
def test_of_a_scene_that_says_its_unit_nothing_is_said(good, units, factor):
    assert said(replace(scaled(good, factor), units=units)) == (None, [])


def test_two_bones_in_one_position_are_said_once(good):
    _, warned = said(replace(good, bones={**good.bones, "copy": good.bones["femur"]}))
    assert sum("of the bone lies in the bone" in message for message in warned) == 1


def test_a_motion_that_can_be_meant_is_not_said():
    """Grids, pauses, reversals, turns with a screw-home, and flexion in RAS."""
    scene = Scene.from_phantom(phantoms.hip())
    assert said(hinged(scene, flexion=np.arange(0.0, 31.0, 5.0))) == (None, [])
    assert said(hinged(scene, angles=[0, 5, 10, 10.1, 10.2, 15, 20])) == (None, [])
    assert said(hinged(scene, flexion=np.arange(0.0, 31.0, 5.0) / 1.12)) == (None, [])
    ras = replace(hinged(scene, axis=(1.0, 0.0, 0.0), flexion=np.arange(0.0, 31.0, 5.0)), frame="RAS")
    assert said(ras) == (None, [])


def test_a_run_says_it_and_writes_nothing_where_it_is_sure(good, tmp_path):
    exchanged = NONSENSE["origin and insertion exchanged"][0](good)
    with pytest.raises(SceneError, match="are exchanged"):
        exchanged.run(tmp_path / "out", figures=False)
    assert not (tmp_path / "out").exists()


def test_a_muscle_that_is_all_fixed_is_said_to_be(tmp_path):
    scene = replace(Scene.load(write_tiny_scene(tmp_path)), fixing={"method": "proximity", "distance": 1e3})
    with pytest.warns(UserWarning, match="no point is deformed"):
        replace(scene, deformer="none", solver={}).run(frames="0:1", figures=False)
    with pytest.warns(UserWarning, match="no point"), pytest.raises(SceneError, match="would tear"):
        scene.run(frames="0:1", figures=False)


def test_a_decimal_comma_is_seen(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("x,y,z\n1.5,2.5,3.5\n-71.55,20.54,1,5\n")
    with pytest.raises(ValueError, match=r"line 3 has 4 cells, but earlier lines have 3; .* decimals with"):
        read_landmarks(path)
    path.write_text("1,5,2,5,3,5\n4,5,2,5,3,5\n")
    with pytest.raises(ValueError, match=r"line 1 has 6 numbers, and no column .* decimals with a point"):
        read_landmarks(path)


def test_a_ring_that_is_read_as_a_curve_is_seen(tmp_path):
    scene = write_tiny_scene(tmp_path / "scene")
    ring = read_landmarks(scene.parent / "attachments/origin.vtp")[0]
    np.savetxt(scene.parent / "origin.csv", ring, delimiter=",", header="x,y,z", comments="")
    text = scene.read_text().replace("attachments/origin.vtp", "origin.csv")
    scene.write_text(text)
    with pytest.warns(UserWarning, match=r"attachments\[0\].landmarks: .* read as an open curve"):
        assert not Scene.load(scene).muscles["spindle"].attachments[0].closed
    for closed in ("true", "false"):
        scene.write_text(text.replace('"origin.csv"', f'"origin.csv", closed = {closed}'))
        assert str(Scene.load(scene).muscles["spindle"].attachments[0].closed).lower() == closed


def test_the_page_lists_all_that_is_checked():
    text = PAGE.read_text()
    for name in NONSENSE:
        assert f"* - {name}\n" in text, name
