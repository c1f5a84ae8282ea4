"""A small example of everything that filters take, for the contract suite: found by a port's name."""

import numpy as np
from phantoms import label_map, spindle_over_hinge
from shapes import lines_of
from vtkmodules.vtkFiltersSources import vtkSphereSource

from vtkmuscle.core.motion.rigid import RigidMotion, apply_transform
from vtkmuscle.data.arrays import add_arrays, blocks_of, multiblock_from, points_of, with_points
from vtkmuscle.data.attachments import Aponeurosis, aponeuroses_data

PHANTOM = spindle_over_hinge()
#: Pipeline times that time-dependent examples announce.
TIMES = (0.0, 2.0, 4.0)
#: From the unit cube to the spindle's box, the template's bottom at the origin (above).
BOX = np.array([[32.0, 0, 0, -16], [0, -32.0, 0, -16], [0, 0, -140.0, 80], [0, 0, 0, 1]])


def rest_bones():
    return deep_copy(PHANTOM.bones)


def moving_bones(time=4.0):
    transforms = PHANTOM.motion.at(time)
    blocks = {}
    for name, bone in blocks_of(PHANTOM.bones):
        transform = transforms.get(name, np.eye(4))
        blocks[name] = with_points(bone, apply_transform(transform, points_of(bone)))
        add_arrays(blocks[name], fields={"Transform": transform.reshape(16)})
    return multiblock_from(blocks)


def muscle():
    return deep_copy(PHANTOM.muscles["spindle"])


def fixed_muscle():
    """Return the muscle, its flat ends fixed to the bones that they lie on."""
    surface = muscle()
    z = points_of(surface)[:, 2]
    fixed_to = np.select([z > 80 - 1e-9, z < -60 + 1e-9], [0, 1], default=-1)
    add_arrays(surface, points={"FixedTo": fixed_to.astype(np.int32)})
    return surface


def deformed_muscle():
    """Return the muscle bent about x."""
    points = points_of(PHANTOM.muscles["spindle"])
    points[:, 1] -= 0.002 * (points[:, 2] - 80) ** 2
    return with_points(muscle(), points)


def carried_muscle(time=4.0):
    """Return the fixed muscle where the lower bone takes it, more and more from above to below."""
    points = points_of(PHANTOM.muscles["spindle"])
    (transform,) = PHANTOM.motion.at(time).values()
    part = np.clip((80.0 - points[:, 2:]) / 140.0, 0.0, 1.0)
    return with_points(fixed_muscle(), points + part * (apply_transform(transform, points) - points))


def neighbours(time=4.0):
    """Return a ball that comes nearer to the spindle, and into it."""
    ball = ball_beside()
    shift = np.array([0.0, -2.0 * time, 0.0])
    moved = with_points(ball, points_of(ball) + shift)
    add_arrays(moved, points={"Displacement": np.tile(shift, (ball.GetNumberOfPoints(), 1))})
    return multiblock_from({"ball": moved})


def ball_beside():
    source = vtkSphereSource(center=(0.0, 0.0, 10.0), radius=15.0, theta_resolution=24, phi_resolution=16)
    source.Update()
    ball = source.GetOutput()
    ball.GetPointData().Initialize()
    return ball


def attachments():
    return deep_copy(PHANTOM.attachments["spindle"])


def template():
    """Return straight lines from the bottom of the unit cube to its top."""
    corners = np.array([(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    data = _lines([(x, y, 0.0) for x in (0.2, 0.5, 0.8) for y in (0.3, 0.7)], (0.0, 0.0, 1.0))
    add_arrays(
        data,
        points={"t": np.tile(np.linspace(0, 1, 8), 6)},
        cells={"FibreId": np.arange(6)},
        fields={"OriginArea": corners, "InsertionArea": corners + np.array([0, 0, 1])},
    )
    return data


def fitted_template():
    data = template()
    fitted = with_points(data, apply_transform(BOX, points_of(data)))
    for name in ("OriginArea", "InsertionArea"):
        add_arrays(fitted, fields={name: apply_transform(BOX, template_corners(data, name))})
    add_arrays(fitted, fields={"Transform": BOX.reshape(16), "FitError": 1.5})
    return fitted


def template_corners(data, name):
    array = data.GetFieldData().GetArray(name)
    return np.array([array.GetTuple(i) for i in range(array.GetNumberOfTuples())])


def fibres():
    """Return lines in the spindle from its origin to its insertion."""
    turn = 2 * np.pi * np.arange(6) / 6
    starts = np.column_stack([4 * np.cos(turn), 4 * np.sin(turn) - 32, np.full(6, 80.0)])
    return _lines(starts, (0.0, 0.0, -140.0))


def paths(time=4.0):
    """Return the fibres as paths, their lower ends moved, with levers about the phantom's hinge."""
    data = fibres()
    count, rest = data.GetNumberOfCells(), points_of(data)
    moved = rest + np.tile(np.linspace(0.0, 1.0, len(rest) // count), count)[:, None] * (0.0, -time, 0.0)
    data = with_points(data, moved)
    cells = {name: np.zeros(count) for name in ("Squeezed", "Sag", "Bow")}
    add_arrays(data, points={"RestPosition": rest}, cells=cells)
    for name, at in (("Length", moved), ("RestLength", rest)):
        steps = np.diff(at.reshape(count, -1, 3), axis=1)
        add_arrays(data, cells={name: np.linalg.norm(steps, axis=2).sum(axis=1)})
    for name in PHANTOM.motion.coordinates:
        add_arrays(data, cells={f"Lever_{name}": np.full(count, -32.0)})
    return data


def aponeuroses():
    """Return two strips along the spindle, on its near and its far side."""
    z, half = np.linspace(-20.0, 40.0, 7), 6.0
    strips = []
    for side, y in (("proximal", 1.0), ("distal", -1.0)):
        edges = [np.column_stack([np.full(7, x), np.full(7, 16.0 * y - 32.0), z]) for x in (-half, half)]
        strips.append(Aponeurosis(side, np.vstack([edges[0], edges[1][::-1]])))
    return aponeuroses_data(strips)


def superficial_fibres():
    """Return three lines beside the spindle's middle that wind a little."""
    along = np.linspace(-0.1, 0.1, 5)
    lines = [
        np.column_stack([17 * np.cos(a + along), 17 * np.sin(a + along) - 32, 10 - 200 * along])
        for a in (0.0, 2.0, 4.0)
    ]
    return lines_of(lines)


def image():
    return label_map(PHANTOM, spacing=8.0)


def _lines(starts, direction, n_points=8):
    along = np.linspace(0, 1, n_points)[None, :, None] * np.asarray(direction)
    return lines_of(np.asarray(starts, dtype=float)[:, None, :] + along)


#: By the name of a port; "FILTER.port" where a filter takes something else by that name.
EXAMPLES = {
    "bones": moving_bones,
    "AttachmentEstimator.bones": rest_bones,
    "BoneMotion.bones": rest_bones,
    "rest_bones": rest_bones,
    "FixedPointDetector.bones": rest_bones,
    "muscle": fixed_muscle,
    "start": carried_muscle,
    "rest_muscle": fixed_muscle,
    "deformed_muscle": deformed_muscle,
    "attachments": attachments,
    "neighbours": neighbours,
    "template": template,
    "SliceMorpher.template": fitted_template,
    "mesh": deformed_muscle,
    "fibres": fibres,
    "rest_fibres": fibres,
    "paths": paths,
    "MomentArms.fibres": paths,
    "superficial": superficial_fibres,
    "aponeuroses": aponeuroses,
    "image": image,
}

#: What changes with the pipeline's time.
MOVING = {moving_bones, carried_muscle, neighbours, paths}

#: Values of parameters that are objects, by their class.
OBJECTS = {RigidMotion: PHANTOM.motion}


def example(kind, port, time=None):
    """Return a new data set for a port of a filter, at a time where it moves."""
    make = EXAMPLES.get(f"{kind.__name__}.{port.name}") or EXAMPLES.get(port.name)
    if make is None:
        raise AssertionError(
            f"no example of {port.name!r}: add an example to tests/filters/examples.py, so that the contract "
            f"suite can run {kind.__name__} (there are: {', '.join(EXAMPLES)})"
        )
    return make(time) if time is not None and make in MOVING else make()


def deep_copy(data):
    copy = data.NewInstance()
    copy.DeepCopy(data)
    return copy
