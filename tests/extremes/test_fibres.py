"""Fibres from extreme input: finite output, or an error that names the cause."""

import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.data.arrays import cell_array, checked_surface, field_array, points_of, surface_from
from vtkmuscle.data.attachments import AttachmentArea, attachments_from, attachments_of
from vtkmuscle.filters import FibreMetrics, FibreTransport, FibreTubes, SliceMorpher
from vtkmuscle.phantoms import spindle_over_hinge
from vtkmuscle.phantoms.implicit import thick_curve
from vtkmuscle.phantoms.meshing import mesh_of, solid_of_revolution
from vtkmuscle.pipelines import decompose

PHANTOM = spindle_over_hinge()
MUSCLE, ATTACHMENTS = PHANTOM.muscles["spindle"], PHANTOM.attachments["spindle"]
AREAS = attachments_of(ATTACHMENTS, "spindle")


SHAPE = checked_surface(MUSCLE, "spindle")


def each(change):
    return attachments_from([AttachmentArea(a.role, a.bone, *change(a)) for a in AREAS])


def denser(area):
    corners = np.vstack([area.landmarks, area.landmarks[:1]])
    place = np.linspace(0, len(corners) - 1, 500, endpoint=False)
    i = place.astype(int)
    return corners[i] + (place - i)[:, None] * (corners[i + 1] - corners[i]), True


def tetrahedron():
    points = np.array([[0, 0, 0], [20, 0, 0], [10, 18, 0], [10, 6, 80.0]])
    areas = [
        AttachmentArea("origin", "a", points[:3], closed=True),
        AttachmentArea("insertion", "b", points[3:], closed=False),
    ]
    triangles = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    return surface_from(points, triangles), attachments_from(areas)


def two_components():
    points, triangles = checked_surface(MUSCLE, "spindle")
    both = np.vstack([triangles, triangles + len(points)])
    return surface_from(np.vstack([points, np.add(points, [200, 0, 0])]), both), ATTACHMENTS


def with_a_handle():
    """Return a muscle of two bellies, one beside the other, that share both ends."""
    z = np.linspace(0.0, 100.0, 9)
    bulge = 16.0 * np.sin(np.pi * z / 100.0)
    bellies = [
        thick_curve(np.column_stack([side * bulge, 0 * z, z]), np.full(9, 8.0)) for side in (-1.0, 1.0)
    ]
    points, triangles = mesh_of(bellies[0].joined(bellies[1], 2.0), 2.0, 3000)
    angles = 2 * np.pi * np.arange(8) / 8
    ring = np.column_stack([5 * np.cos(angles), 5 * np.sin(angles)])
    ends = [
        AttachmentArea(role, bone, np.column_stack([ring, np.full(8, height)]), closed=True)
        for role, bone, height in (("origin", "a", -6.2), ("insertion", "b", 106.2))
    ]
    return surface_from(points, triangles), attachments_from(ends)


def of_a_million_triangles():
    """Return a spindle of 1 075 200 triangles."""
    s = np.linspace(0.0, 1.0, 1041)
    points, triangles = solid_of_revolution(120.0 * s, 8.0 + 8.0 * np.sin(np.pi * s) ** 2, 480)
    angles = 2 * np.pi * np.arange(12) / 12
    ring = np.column_stack([7 * np.cos(angles), 7 * np.sin(angles), np.zeros(12)])
    ends = [
        AttachmentArea("origin", "a", ring, closed=True),
        AttachmentArea("insertion", "b", np.add(ring, [0, 0, 120.0]), closed=True),
    ]
    return surface_from(points, triangles), attachments_from(ends)


EXTREMES = {
    "one fibre": (MUSCLE, ATTACHMENTS, {"n_fibres": 1}),
    "one segment": (MUSCLE, ATTACHMENTS, {"resolution": 1}),
    "300 segments": (MUSCLE, ATTACHMENTS, {"n_fibres": 5, "resolution": 300}),
    "1000 segments": (MUSCLE, ATTACHMENTS, {"n_fibres": 5, "resolution": 1000}),
    "10 000 fibres": (MUSCLE, ATTACHMENTS, {"n_fibres": 10_000, "resolution": 5}),
    "one landmark": (MUSCLE, each(lambda a: (a.landmarks[:1], False)), {}),
    "500 landmarks": (MUSCLE, each(denser), {}),
    "landmarks 20 mm off": (MUSCLE, each(lambda a: (np.add(a.landmarks, [0, 20, 0]), a.closed)), {}),
    "four triangles": (*tetrahedron(), {}),
    "two components": (*two_components(), {}),
    "a handle": (*with_a_handle(), {}),
    "a million triangles": (of_a_million_triangles, {}),
    "a hole": (surface_from(SHAPE[0], SHAPE[1][1:]), ATTACHMENTS, {}),
    "areas that overlap": (
        MUSCLE,
        attachments_from([AREAS[0], AttachmentArea("insertion", "b", AREAS[0].landmarks - [0, 0, 2], True)]),
        {},
    ),
}


#: Those that take long.
IN_THE_LONG_FORM = ("1000 segments", "10 000 fibres", "a million triangles")
GROUP = "Fibres, by planes and by a harmonic function"
METHODS = SliceMorpher.__dict__["method"].choices


def finite_and_measured(rest, muscle):
    """Carry fibres with a muscle that stays where it is and measure them; return how far they are outside."""
    moved = FibreTransport(weight_tolerance=1.0)(rest, muscle, muscle)
    assert_allclose(points_of(moved), points_of(rest), atol=1e-7)
    measured = FibreMetrics(architecture=True)(moved, muscle)
    for name in ("Length", "Tortuosity", "Strain", "PennationOrigin", "LineAngle"):
        assert np.isfinite(cell_array(measured, name, "fibres")).all()
    for name in ("PCSA", "CentroidPath"):
        assert np.isfinite(field_array(measured, name)).all()
    surface, points = solids_of(*checked_surface(muscle, "test")), points_of(rest)
    return np.where(surface.depth(points) > 0, 0.0, np.abs(surface.distances(points))).max()


#: What cannot be filled, by which methods, and what the message says of it.
CANNOT_BE = {
    "a hole": (METHODS, "3 triangle edge"),
    "areas that overlap": (("harmonic",), "the origin and the insertion area overlap"),
}
CAN_BE = [
    (case, method) for case in EXTREMES for method in METHODS if method not in CANNOT_BE.get(case, ((),))[0]
]


@pytest.mark.parametrize(("case", "method"), CAN_BE)
def test_fibres_of_extreme_input_are_finite_and_in_the_muscle(case, method, ledger):
    if not ledger.long and (case in IN_THE_LONG_FORM or method != "auto"):
        pytest.skip("in the long form")
    *made, settings = EXTREMES[case]
    muscle, attachments = made if len(made) == 2 else made[0]()
    with warnings.catch_warnings():
        # That planes do not suit a muscle is told; any other warning is an error.
        warnings.filterwarnings("ignore", message="SliceMorpher: the muscle is bent too much")
        chain = decompose(muscle, attachments, **{"n_fibres": 12, "method": method, **settings})
        rest = chain.update().output
    assert rest.GetNumberOfCells() == settings.get("n_fibres", 12)
    outside = finite_and_measured(rest, muscle)
    if rest.GetNumberOfCells() < 1000:
        assert np.isfinite(points_of(FibreTubes()(FibreMetrics()(rest, muscle)))).all()
    ledger.passed(GROUP, case, "farthest point outside [mm]", outside)


@pytest.mark.parametrize("case", CANNOT_BE)
def test_what_cannot_be_filled_is_named(case, ledger):
    methods, message = CANNOT_BE[case]
    muscle, attachments, settings = EXTREMES[case]
    for method in methods:
        with pytest.raises(ValueError, match=message) as caught:
            decompose(muscle, attachments, n_fibres=12, method=method, **settings).update()
        ledger.refused(GROUP, case, str(caught.value))
