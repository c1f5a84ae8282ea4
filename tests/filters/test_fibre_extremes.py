"""Fibres from extreme input: finite output, or an error that names the cause."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vtkmuscle.filters import FibreMetrics, FibreTransport, FibreTubes
from vtkmuscle.filters.arrays import cell_array, checked_surface, field_array, points_of, surface_from
from vtkmuscle.filters.attachments import AttachmentArea, attachments_from, attachments_of
from vtkmuscle.phantoms import pennate_block, spindle_over_hinge
from vtkmuscle.pipelines import decompose

PHANTOM = spindle_over_hinge()
MUSCLE, ATTACHMENTS = PHANTOM.muscles["spindle"], PHANTOM.attachments["spindle"]
AREAS = attachments_of(ATTACHMENTS, "spindle")


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


EXTREMES = {
    "one fibre": (MUSCLE, ATTACHMENTS, {"n_fibres": 1}),
    "one segment": (MUSCLE, ATTACHMENTS, {"resolution": 1}),
    "300 segments": (MUSCLE, ATTACHMENTS, {"n_fibres": 5, "resolution": 300}),
    "one landmark": (MUSCLE, each(lambda a: (a.landmarks[:1], False)), {}),
    "500 landmarks": (MUSCLE, each(denser), {}),
    "landmarks 20 mm off": (MUSCLE, each(lambda a: (np.add(a.landmarks, [0, 20, 0]), a.closed)), {}),
    "four triangles": (*tetrahedron(), {}),
    "two components": (*two_components(), {}),
    "areas that overlap": (
        MUSCLE,
        attachments_from([AREAS[0], AttachmentArea("insertion", "b", AREAS[0].landmarks - [0, 0, 2], True)]),
        {},
    ),
}


@pytest.mark.parametrize("case", EXTREMES)
def test_extreme_input_gives_finite_fibres_that_are_carried_and_measured(case):
    muscle, attachments, settings = EXTREMES[case]
    rest = decompose(muscle, attachments, **{"n_fibres": 12, **settings}).update().output
    moved = FibreTransport(prune=1.0)(rest, muscle, muscle)
    assert_allclose(points_of(moved), points_of(rest), atol=1e-7)
    measured = FibreMetrics(architecture=True, curvature=True, sections=3)(moved, muscle)
    for name in ("Length", "Tortuosity", "Strain", "PennationOrigin", "CurvatureMax", "LineAngle"):
        assert np.isfinite(cell_array(measured, name, case)).all()
    for name in ("PCSA", "CentroidPath", "SectionDensity"):
        assert np.isfinite(field_array(measured, name)).all()
    assert np.isfinite(points_of(FibreTubes(radius_by="fill")(measured, muscle))).all()


def test_a_hole_is_named():
    points, triangles = checked_surface(MUSCLE, "spindle")
    with pytest.raises(ValueError, match="3 triangle edge"):
        decompose(surface_from(points, triangles[1:]), ATTACHMENTS).update()


def test_the_pennate_block_is_measured_as_it_is_known():
    phantom = pennate_block()
    muscle = phantom.muscles["block"]
    fibres = decompose(muscle, phantom.attachments["block"], template="pennate", n_fibres=30)
    measured = FibreMetrics(architecture=True)(fibres, muscle)
    known = phantom.known
    assert_allclose(cell_array(measured, "Length", ""), known["fibre_length"], rtol=0.005)
    for end in ("PennationOrigin", "PennationInsertion"):
        assert_allclose(cell_array(measured, end, ""), known["pennation"], atol=1.0)
    assert_allclose(field_array(measured, "MuscleVolume"), known["volume"], rtol=0.001)
    assert_allclose(field_array(measured, "PCSA"), known["volume"] / known["fibre_length"], rtol=0.005)
