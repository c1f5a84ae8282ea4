from dataclasses import replace

import numpy as np
import pytest
import pyvista as pv
from phantoms import fibre_block
from vtkmodules.vtkCommonDataModel import vtkCellArray

from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.data import arrays
from vtkmuscle.data.attachments import (
    Aponeurosis,
    aponeuroses_data,
    aponeuroses_of,
    attachments_from,
    attachments_of,
)
from vtkmuscle.filters import FibreMetrics, FibreSource
from vtkmuscle.io import read_aponeurosis, read_polydata, read_surface
from vtkmuscle.phantoms import spindle_over_hinge
from vtkmuscle.phantoms.meshing import box
from vtkmuscle.phantoms.phantom import ends
from vtkmuscle.pipelines import decompose

#: The block is 20 x 40 x 120 mm; fibres go from the lower half of x = 0 to the upper half of x = 20.
WIDTH, DEPTH, LENGTH = 20.0, 40.0, 120.0


@pytest.fixture(scope="module")
def block():
    phantom = fibre_block("pennate")
    return phantom.muscles["block"], phantom.attachments["block"]


def ring(x, low, high, y=(0.0, DEPTH)):
    return np.array([(x, y[0], low), (x, y[1], low), (x, y[1], high), (x, y[0], high)])


def sides(surface):
    """Return the corner that the block's coordinates are counted from."""
    return arrays.points_of(surface).min(axis=0)


def two_rings(muscle, low=(0.0, 60.0), high=(60.0, 120.0)):
    corner = sides(muscle)
    return [
        Aponeurosis("proximal", corner + ring(0.0, *low)),
        Aponeurosis("distal", corner + ring(WIDTH, *high)),
    ]


def lengths_of(fibres):
    lines = arrays.polylines_of(fibres, "fibres")
    return polyline_lengths(lines.points, lines.offsets)


def test_pennate_fibres_have_their_known_length_and_pennation(block):
    muscle, attachments = block
    fibres = FibreSource(n_fibres=100)(muscle, attachments)
    assert arrays.field_string(fibres, "Course") == "straight"
    length = np.hypot(WIDTH, LENGTH / 2)
    assert lengths_of(fibres).mean() == pytest.approx(length, rel=0.01)
    assert np.abs(lengths_of(fibres) / length - 1).max() < 0.05
    measured = FibreMetrics()(fibres, muscle)
    known = np.degrees(np.arctan2(WIDTH, LENGTH / 2))
    for name in ("PennationOrigin", "PennationInsertion"):
        assert arrays.cell_array(measured, name, "fibres").mean() == pytest.approx(known, abs=1.0)
    assert not arrays.cell_array(fibres, "Bent", "fibres").any()


def test_bipennate_fibres_end_on_the_tendon_in_the_middle():
    phantom = fibre_block("bipennate")
    muscle = phantom.muscles["block"]
    fibres = FibreSource(n_fibres=200)(muscle, phantom.attachments["block"])
    lines = arrays.polylines_of(fibres, "fibres").points.reshape(200, -1, 3) - sides(muscle)
    assert np.abs(lines[:, -1, 0] - WIDTH / 2).max() < 0.2
    assert (np.minimum(lines[:, 0, 0], WIDTH - lines[:, 0, 0]) < 0.2).all()
    assert np.median(lengths_of(fibres)) == pytest.approx(np.hypot(WIDTH / 2, LENGTH / 2), rel=0.02)


def test_a_muscle_is_filled_by_the_way_that_suits_it(block):
    phantom = fibre_block("parallel")
    whole = FibreSource(n_fibres=30)(phantom.muscles["block"], phantom.attachments["block"])
    assert arrays.field_string(whole, "Course") == "straight"
    assert arrays.field_array(whole, "FilledShare") == pytest.approx(1.0, abs=0.05)
    assert lengths_of(whole).mean() == pytest.approx(LENGTH, rel=0.01)
    spindle = spindle_over_hinge()
    muscle, areas = spindle.muscles["spindle"], spindle.attachments["spindle"]
    by_sections = FibreSource(n_fibres=30)(muscle, areas)
    assert arrays.field_string(by_sections, "Course") == "sections"
    assert arrays.field_array(by_sections, "FilledShare") < 0.5
    template = decompose(muscle, areas, n_fibres=30, method="harmonic", end_rule="shared").update().output
    assert np.array_equal(arrays.points_of(by_sections), arrays.points_of(template))


def test_rings_as_aponeuroses_are_as_good_as_areas(block):
    muscle, attachments = block
    between = FibreSource(n_fibres=60)(muscle, None, None, aponeuroses_data(two_rings(muscle)))
    assert arrays.field_string(between, "Course") == "straight"
    areas = FibreSource(n_fibres=60)(muscle, attachments)
    assert lengths_of(between).mean() == pytest.approx(lengths_of(areas).mean(), rel=0.01)


def test_an_aponeurosis_may_be_several_rings_or_a_surface_within_the_muscle(block):
    muscle, _ = block
    corner = sides(muscle)
    plane = pv.Plane(
        center=corner + np.array([WIDTH / 2, DEPTH / 2, 90.0]),
        direction=(1, 0, 0),
        i_size=59.0,
        j_size=39.0,
        i_resolution=12,
        j_resolution=8,
    ).triangulate()
    assert plane.bounds[0] == pytest.approx(plane.bounds[1])
    inner = arrays.surface_from(arrays.points_of(plane), plane.regular_faces)
    arrays.add_arrays(inner, fields={"Side": "distal"})
    rings = [Aponeurosis("proximal", corner + ring(x, 0.0, 60.0)) for x in (0.0, WIDTH)]
    blocks = aponeuroses_data([*rings, Aponeurosis("distal", arrays.points_of(inner), plane.regular_faces)])
    assert [len(one.triangles) > 0 for one in aponeuroses_of(blocks, "test")] == [False, False, True]
    fibres = FibreSource(n_fibres=100)(muscle, None, None, blocks)
    lines = arrays.polylines_of(fibres, "fibres").points.reshape(100, -1, 3) - corner
    assert np.abs(lines[:, -1, 0] - WIDTH / 2).max() < 1e-6
    assert abs((lines[:, 0, 0] < 1.0).sum() - 50) <= 3


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda near, far, muscle: [near], "there is no distal aponeurosis"),
        (
            lambda near, far, muscle: [near, replace(far, points=np.add(far.points, (30.0, 0, 0)))],
            "from the muscle",
        ),
        (
            lambda near, far, muscle: [near, replace(far, points=sides(muscle) + ring(0.0, 20.0, 110.0))],
            "the aponeuroses overlap",
        ),
        (
            lambda near, far, muscle: [replace(far, side="proximal"), replace(near, side="distal")],
            "closer to the insertion than the distal aponeurosis",
        ),
        (
            lambda near, far, muscle: [near, Aponeurosis("distal", *arrays.checked_surface(muscle, "test"))],
            "aponeurosis covers",
        ),
    ],
)
def test_what_cannot_be_meant_is_refused(block, change, says):
    muscle, attachments = block
    sheets = aponeuroses_data(change(*two_rings(muscle), muscle))
    with pytest.raises(ValueError, match=says):
        FibreSource(n_fibres=10)(muscle, attachments, None, sheets)


@pytest.mark.realdata
def test_fibres_between_the_aponeuroses_of_a_gastrocnemius_are_as_long_as_measured_ones(dti_gastrocnemius):
    folder = dti_gastrocnemius
    muscle = read_surface(folder / "muscle.vtp")
    sheets = [
        read_aponeurosis(folder / f"{name}.vtp", side)
        for name, side in (("origin", "proximal"), ("insertion", "distal"))
    ]
    fibres = FibreSource(n_fibres=400)(muscle, None, None, aponeuroses_data(sheets))
    tracts = read_polydata(folder / "tracts.vtp")
    tracts.SetVerts(vtkCellArray())
    tracts = arrays.polylines_of(tracts, "tracts")
    measured = np.median(polyline_lengths(tracts.points, tracts.offsets))
    assert np.median(lengths_of(fibres)) == pytest.approx(measured, rel=0.08)
    assert not arrays.cell_array(fibres, "Bent", "fibres").any()


def test_sections_are_planes_where_the_areas_overlap(block):
    muscle, attachments = block
    corner = sides(muscle)
    origin, insertion = attachments_of(attachments, "test")
    joined = [
        replace(origin, landmarks=corner + ring(0.0, 0.0, 60.0)),
        replace(insertion, landmarks=corner + ring(0.0, 50.0, 120.0)),
    ]
    for areas, method in ((attachments, "harmonic"), (attachments_from(joined), "plane")):
        fibres = FibreSource(n_fibres=10, course="sections")(muscle, areas)
        assert arrays.field_string(fibres, "MorphMethod") == method


@pytest.mark.parametrize("thickness", [1.5, 6.0])
def test_fibres_fill_a_strap_that_is_bent_over_a_bone(thickness):
    """They keep the middle of its thickness, and all of it: spacing is of its volume, not of its box."""
    radius, straight, width = 30.0 + 0.5 * thickness, 60.0, 20.0
    wound = 2.0 * straight + 0.5 * np.pi * radius
    places, triangles = box(
        (0.0, 0.0, -0.5 * thickness), (wound, width, 0.5 * thickness), max(thickness, 2.0)
    )

    def bent(flat):
        turn = np.clip((flat[:, 0] - straight) / radius, 0.0, 0.5 * np.pi)
        out, on = flat[:, 2] + radius, flat[:, 0] - straight - radius * turn
        x, z = out * np.sin(turn) + on * np.cos(turn), out * np.cos(turn) - on * np.sin(turn)
        return np.column_stack([x, flat[:, 1], z])

    half = 0.5 * thickness
    corners = np.array([[0.0, y, z] for z, ys in ((-half, (0, 10, 20)), (half, (20, 10, 0))) for y in ys])
    muscle = arrays.surface_from(bent(places), triangles)
    areas = attachments_from(ends("a", bent(corners), "b", bent(corners + np.array([wound, 0.0, 0.0]))))
    fibres = arrays.points_of(FibreSource()(muscle, areas)).reshape(100, 16, 3)
    heights = np.hypot(fibres[:, 7:9, 0], fibres[:, 7:9, 2]) - radius
    assert np.abs(heights.mean(axis=0)).max() < 0.15
    assert heights.std(axis=0).min() > 0.25 * thickness  # evenly spread: 0.29
