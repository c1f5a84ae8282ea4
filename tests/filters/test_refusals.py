"""Input that filters refuse, each with the reason: one change of the examples that all filters run on."""

from functools import partial

import numpy as np
import pytest
import pyvista as pv
from filter_case import Case
from shapes import lines_of
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid

import examples
from vtkmuscle import filters
from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.data import arrays
from vtkmuscle.data.attachments import AttachmentArea, attachments_from, attachments_of
from vtkmuscle.data.label_images import label_image

N = examples.muscle().GetNumberOfPoints()
GRID = pv.ImageData(dimensions=(3, 3, 7), spacing=(10, 10, 20), origin=(-10, -42, -50))


def other_triangles(change):
    muscle = examples.fixed_muscle()
    surface = arrays.surface_from(arrays.points_of(muscle), change(arrays.triangles_of(muscle, "")))
    return arrays.add_arrays(surface, points={"FixedTo": arrays.point_array(muscle, "FixedTo", "")})


opened = partial(other_triangles, lambda triangles: triangles[1:])
in_another_order = partial(other_triangles, lambda triangles: np.roll(triangles, 1, axis=0))
of_two_sides = partial(other_triangles, lambda triangles: np.vstack([triangles[:99], triangles[99:, ::-1]]))


def fixed_to(*values):
    marks = np.resize(np.array(values), (N, *np.shape(values)[1:]))
    return lambda: arrays.add_arrays(examples.muscle(), points={"FixedTo": marks})


def detected():
    """Return the muscle with points fixed to the bones in another order."""
    bones = arrays.multiblock_from(dict(reversed(arrays.blocks_of(examples.rest_bones()))))
    return filters.FixedPointDetector().apply(examples.muscle(), bones, examples.attachments())


def far_paths():
    paths = examples.paths()
    rest = 500.0 + arrays.point_array(paths, "RestPosition", "")
    return arrays.add_arrays(paths, points={"RestPosition": rest})


def with_transform(transform):
    return lambda: arrays.add_arrays(examples.fitted_template(), fields={"Transform": transform.ravel()})


def without_areas():
    template = examples.template()
    template.GetFieldData().RemoveArray("OriginArea")
    return template


def bones(**fields):
    """Return moving bones, the second with other field arrays; None removes an array."""

    def changed():
        data = examples.moving_bones()
        for name, value in fields.items():
            data.GetBlock(1).GetFieldData().RemoveArray(name)
            if value is not None:
                arrays.add_arrays(data.GetBlock(1), fields={name: value})
        return data

    return changed


def areas(*ends):
    """Return areas by role and landmarks."""
    return attachments_from([AttachmentArea(role, "proximal", ring, closed=True) for role, ring in ends])


ORIGIN = attachments_of(examples.attachments(), "test")[0].landmarks
SAME = areas(("origin", ORIGIN), ("insertion", ORIGIN))


def not_finite():
    grid = GRID.cast_to_unstructured_grid()
    grid.points[3, 1] = np.nan
    return grid


def points_alone():
    mesh = vtkUnstructuredGrid()
    mesh.SetPoints(GRID.cast_to_unstructured_grid().GetPoints())
    return mesh


KINDS = pv.CellType.EMPTY_CELL, pv.CellType.VERTEX
EMPTY_CELL = pv.UnstructuredGrid([0, 1, 0], KINDS, [[0.0, -32.0, 10.0]])

LINES = arrays.points_of(examples.fibres()).reshape(6, -1, 3)
TURNED = [line[::-1] if number > 2 else line for number, line in enumerate(LINES)]
AT_REST = "BoneMotion", "FixedPointDetector", "AttachmentEstimator"
MOVED = partial(arrays.add_arrays, examples.muscle(), points={"Displacement": np.eye(3)[np.arange(N) % 3]})
DEFORMED = ("PBDDeformer", "muscle"), ("PathDeformer", "muscle"), ("TautPaths", "rest_muscle")
RESTING = *DEFORMED, ("FixedPointDetector", "muscle"), ("FibreTransport", "rest_muscle")
#: Filters, their changed inputs and parameters, and the words of the error.
REFUSED = [
    ("AttachmentEstimator", {"origin": "ulna"}, "origin is 'ulna', but .* proximal, distal"),
    ("AttachmentEstimator", {"origin": "distal", "insertion": "distal"}, "both 'distal'"),
    (
        "AttachmentEstimator",
        {"bones": lambda: arrays.multiblock_from(dict(arrays.blocks_of(examples.rest_bones())[:1]))},
        "is near fewer than two bones; .* 'proximal' .*; .* or give landmarks",
    ),
    *((name, {"bones": examples.moving_bones}, "block 'distal': the bone has moved") for name in AT_REST),
    ("BoneMotion", {"motion": hinge("ulna", (0, 0, 0), (1, 0, 0), [0.0, 1.0])}, "'ulna', but .* 'distal'"),
    *(
        (
            "FibreMetrics",
            {
                "fibres": lambda bad=bad: arrays.add_arrays(
                    examples.fibres(), cells={"RestLength": np.full(6, bad)}
                )
            },
            "the rest length of fibre 0 is",
        )
        for bad in (-1.0, np.nan, np.inf)
    ),
    ("FibreMetrics", {"architecture": True, "muscle": None}, "architecture needs a muscle"),
    ("FibreMetrics", {"architecture": True, "muscle": opened}, "architecture needs a closed surface"),
    ("FibreSmoother", {"muscle": None}, "the port 'muscle' is not connected"),
    ("FibreSource", {"course": "sections"}, "course='sections' leads fibres between attachment areas"),
    ("FibreSource", {"attachments": None, "aponeuroses": None}, "connect attachments or aponeuroses"),
    ("FibreSource", {"attachments": SAME, "aponeuroses": None, "course": "straight"}, "share most points"),
    ("FibreSource", {"attachments": SAME, "aponeuroses": None, "course": "sections"}, "share most points"),
    ("FibreTransport", {"rest_muscle": opened}, "rest_muscle: the surface has 3 open edge"),
    *(
        (kind, {"deformed_muscle": other}, rf"has other triangles than rest_muscle, of {N}")
        for kind in ("FibreTransport", "StiffTendons")
        for other in (examples.ball_beside, in_another_order)
    ),
    ("FibreTrimmer", {"attachments": SAME}, "no direction"),
    ("FibreTrimmer", {"fibres": lines_of([[[0, -9, 70.0], [0, -9, -50]], [[0, -9, 40]]])}, "points, first 1"),
    ("FibreTubes", {"fibres": lines_of([[[3, 3, 3]] * 4])}, "all lengths are 0"),
    ("LabelSurfaces", {"labels": "spindel"}, "did you mean 'spindle'"),
    *(
        ("LabelSurfaces", {"image": label_image(np.full((3, 3, 3), value), np.eye(4), {})}, reason)
        for value, reason in (
            (np.uint8(0), "from 0 to 0"),
            (np.int16(-1), "from -1 to -1"),
            (np.float32(1), "no point scalars of whole numbers"),
        )
    ),
    ("LinearBlendFibres", {"insertion": "tibia"}, "is 'tibia', but the bones are 'proximal'"),
    ("MomentArms", {"motion": None}, "fibres: the fibres have no time steps"),
    *((name, {muscle: MOVED}, "muscle: the muscle has moved; connect") for name, muscle in RESTING),
    *((name, {muscle: opened}, "is open: 3 edges") for name, muscle in DEFORMED),
    *((name, {muscle: of_two_sides}, "closed and oriented, but") for name, muscle in DEFORMED),
    ("PathDeformer", {"paths": examples.fibres}, "paths: the point array 'RestPosition' is missing"),
    ("PathDeformer", {"paths": far_paths}, "muscle: no path passes through the muscle at rest; connect its"),
    *((name, {"muscle": detected}, "was 'distal' at .*, but") for name in ("PBDDeformer", "PathDeformer")),
    (
        "PathDeformer",
        {"neighbours": lambda: arrays.multiblock_from({"ball": examples.ball_beside()})},
        "neighbours, block 'ball'.*Displacement",
    ),
    ("PBDDeformer", {"muscle": examples.muscle}, "'FixedTo' is missing"),
    *((name, {"muscle": fixed_to(0, 1)}, "would tear") for name in ("PBDDeformer", "PathDeformer")),
    ("PBDDeformer", {"muscle": lambda: pv.wrap(examples.muscle()).strip()}, "run vtkTriangleFilter"),
    ("PBDDeformer", {"muscle": lambda: arrays.surface_from(np.eye(3), [[0, 1, 3]])}, "that is no point"),
    ("PBDDeformer", {"muscle": fixed_to(2)}, "muscle.* 2 is neither -1"),
    ("PBDDeformer", {"muscle": fixed_to(-2)}, "muscle.* -2 is neither -1"),
    ("PBDDeformer", {"muscle": fixed_to(0.5)}, "a whole number per point"),
    ("PBDDeformer", {"muscle": fixed_to((0, 0))}, "a whole number per point"),
    ("PBDDeformer", {"bones": bones(Transform=None)}, "'distal': .*'Transform' is missing; BoneMotion"),
    ("PBDDeformer", {"bones": bones(Transform=np.diag([2, 2, 2, 1.0]).ravel())}, "'distal': .*rotation and"),
    ("PBDDeformer", {"bones": bones(Transform=np.eye(3).ravel())}, "must be 16 numbers"),
    (
        "PBDDeformer",
        {"rest_bones": bones(Transform=np.diag([1.0, -1, -1, 1]).ravel())},
        "rest_bones, block 'distal': the bone has moved; connect the bones at rest",
    ),
    ("PBDDeformer", {"start": examples.ball_beside}, rf"start: it has \d+ points, but the muscle {N}"),
    ("SliceMorpher", {"method": "harmonic", "attachments": None}, "the port 'attachments' is not connected"),
    ("SliceMorpher", {"template": examples.template}, "'Transform' is missing; run TemplateFitter"),
    *(
        ("SliceMorpher", {"template": with_transform(transform)}, "'Transform' is not the matrix of a box")
        for transform in (
            np.eye(4) + np.eye(4, k=1) * [[1.0], [0], [0], [0]],  # sheared
            np.diag([1.0, 0, 1, 1]),
            np.full((4, 4), np.nan),
            np.eye(3),
        )
    ),
    ("SliceMorpher", {"muscle": opened}, "the surface must be closed"),
    ("SliceMorpher", {"superficial": lines_of(np.zeros((1, 2, 3)))}, "have length 0.*; digitise two points"),
    (
        "StiffTendons",
        {name: lines_of([np.eye(3), np.eye(3)[:2]]) for name in ("fibres", "rest_fibres")},
        "rest_fibres: lines have 2 to 3 points",
    ),
    ("StiffTendons", {"fibres": lines_of([np.eye(3)] * 2)}, "fibres: numbers of points differ"),
    ("StiffTendons", {"paths": vtkPolyData()}, "paths: the data set has no paths"),
    ("TautPaths", {"rest_fibres": lines_of(0.001 * LINES)}, "rest_fibres: no path passes .* check units"),
    ("TautPaths", {"rest_fibres": lines_of(TURNED)}, "rest_fibres: fibre 3 runs the other way than fibre 0"),
    ("TautPaths", {"rest_fibres": None, "rest_muscle": fixed_to(0, 1)}, "rest_muscle: no line over the"),
    ("TemplateFitter", {"attachments": areas(("origin", ORIGIN))}, "attachments: .* role 'insertion'"),
    ("TemplateFitter", {"axis": "attachments", "attachments": SAME}, "set axis='principal'"),
    ("TemplateFitter", {"template": without_areas}, "'OriginArea'.*missing"),
]


@pytest.mark.parametrize(("name", "changes", "message"), REFUSED)
def test_input_is_refused_with_the_reason(name, changes, message):
    case = Case(getattr(filters, name))
    algorithm = case.filter(*case.inputs())
    for port, value in changes.items():
        setattr(algorithm, port, value() if callable(value) else value)
    with pytest.raises(ValueError, match=message) as caught:
        algorithm.update()
    assert name in str(caught.value)
