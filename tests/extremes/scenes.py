"""Muscles that are like none, the modes of the solver, and a run that is looked at from outside."""

import warnings

import numpy as np

from vtkmuscle.core.mesh.rest_shape import dihedral_angles
from vtkmuscle.core.mesh.surface import edge_lengths, mesh_topology, signed_volume, unique_edges
from vtkmuscle.core.motion.rigid import RigidMotion, rotation_about
from vtkmuscle.data import arrays
from vtkmuscle.filters.bone_motion import BoneMotion
from vtkmuscle.filters.pbd_deformer import PBDDeformer
from vtkmuscle.phantoms.meshing import box

#: The modes of the deformer: stable, as by default, and as printed.
STABLE = [{}, {"collision": "off"}, {"anisotropy": "off"}, {"quality": "preview"}]
PUBLISHED = [
    {"quality": "published", "collision": collision, "anisotropy": anisotropy}
    for collision in ("voxel", "off")
    for anisotropy in ("fibres", "always")
]
MODES = STABLE + PUBLISHED

#: What the stable modes keep to: the relative error of the volume, the longest edge by its length at rest,
#: the number of folded edges (bent over 149 degrees that were under 126), and, from so many iterations on,
#: the 95th percentile of the change of angles [degrees].
VOLUME_BOUND, EDGE_BOUND, FOLD_BOUND, ITERATIONS, TURN_BOUND = 1e-6, 12.0, 12, 10, 30.0

#: Edges shorter than this part of the mean say nothing of a shape.
SHORT = 0.01


def tube(rings=9, around=8, length=100.0, radius=12.0):
    """Return points and triangles of a spindle along z; flat pairs at its ends."""
    z = np.linspace(-length / 2, length / 2, rings)
    r = radius * (0.5 + 0.5 * np.cos(np.pi * z / length))
    turn = 2 * np.pi * np.arange(around) / around
    body = np.stack(
        [np.outer(r, np.cos(turn)), np.outer(r, np.sin(turn)), np.repeat(z[:, None], around, 1)], axis=2
    ).reshape(-1, 3)
    points = np.vstack([body, [[0, 0, -length / 2], [0, 0, length / 2]]])
    triangles = []
    for i in range(rings - 1):
        for j in range(around):
            a, b = i * around + j, i * around + (j + 1) % around
            triangles += [[a, b, a + around], [b, b + around, a + around]]
    last, n = (rings - 1) * around, len(body)
    for j in range(around):
        k = (j + 1) % around
        triangles += [[k, j, n], [last + j, last + k, n + 1]]
    return points, np.array(triangles)


def fixed_ends(points, part=0.1):
    """Return FixedTo: the lowest part along z to bone 0, the highest to bone 1."""
    low, high = points[:, 2].min(), points[:, 2].max()
    height = (points[:, 2] - low) / (high - low)
    return np.where(height < part, 0, np.where(height > 1 - part, 1, -1)).astype(np.int32)


def with_duplicate(gap):
    """A spindle with an edge opened to two triangles whose third side is as long as the gap."""
    points, triangles = tube()
    a, b = 4 * 8, 4 * 8 + 1
    # A new point beside a, tied to it and to b by two triangles without much area, back to back.
    new = len(points)
    points = np.vstack([points, points[a] + [0, 0, gap]])
    return points, _split_edge(triangles, a, b, new)


def _split_edge(triangles, a, b, new):
    """Return triangles in which the edge a b runs through a new point."""
    result = []
    for triangle in triangles.tolist():
        if a in triangle and b in triangle:
            (c,) = set(triangle) - {a, b}
            forward = triangle[(triangle.index(a) + 1) % 3] == b
            result += [[a, new, c], [new, b, c]] if forward else [[new, a, c], [b, new, c]]
        else:
            result.append(triangle)
    return np.array(result)


def folded():
    """A spindle with a point pressed through its neighbours: pairs folded back by nearly 180 degrees."""
    points, triangles = tube()
    points[4 * 8] = points[4 * 8 + 1] + 0.999 * (points[4 * 8 + 2] - points[4 * 8 + 1])
    return points, triangles


def sliver(aspect):
    """A spindle of triangles with this ratio of length to height."""
    points, triangles = tube()
    points = np.vstack([points, points[4 * 8] * (1 - 0.5) + 0.5 * points[4 * 8 + 1]])
    edge = np.linalg.norm(points[4 * 8 + 1] - points[4 * 8])
    triangles = _split_edge(triangles, 4 * 8, 4 * 8 + 1, len(points) - 1)
    # One of the points opposite comes so near that its triangles are slivers.
    towards = points[4 * 8] * 0.6 + 0.4 * points[4 * 8 + 1]
    outward = towards * [1, 1, 0] / np.linalg.norm(towards[:2])
    points[-1] = towards + outward * edge / aspect
    return points, triangles


def star(neighbours):
    """A spindle whose lower end is a point of so many neighbours."""
    return tube(rings=5, around=neighbours)


def tetrahedron():
    """Four triangles."""
    points = np.array([[0.0, 0, 50], [20, 0, -50], [-10, 17, -50], [-10, -17, -39]])
    return points, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])


def two_components():
    """Two spindles side by side, both fixed at their ends."""
    points, triangles = tube()
    beside = points + np.array([40.0, 0.0, 0.0])
    return np.vstack([points, beside]), np.vstack([triangles, triangles + len(points)])


def genus(holes):
    """A block with so many square tunnels across it, along z, as the faces of cubes."""
    full = np.ones((3, 3, 2 * holes + 1), dtype=bool)
    full[1, :, 1::2] = False
    corners, triangles = {}, []
    for cell in np.argwhere(full):
        for axis in range(3):
            for side in (0, 1):
                beyond = cell.copy()
                beyond[axis] += 2 * side - 1
                inside = ((beyond >= 0) & (beyond < full.shape)).all()
                if inside and full[tuple(beyond)]:
                    continue
                u, v = (axis + 1) % 3, (axis + 2) % 3
                face = []
                for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)):
                    corner = cell.copy()
                    corner[axis] += side
                    corner[u] += du
                    corner[v] += dv
                    face.append(corners.setdefault(tuple(corner.tolist()), len(corners)))
                if not side:
                    face.reverse()
                triangles += [[face[0], face[1], face[2]], [face[0], face[2], face[3]]]
    points = (np.array(list(corners), dtype=float) - [1.5, 1.5, holes + 0.5]) * [
        10,
        10,
        100 / (2 * holes + 1),
    ]
    return points, np.array(triangles)


MESHES = {
    "flat pairs": tube,
    "pairs folded by 180 degrees": folded,
    "zero-area pairs": lambda: with_duplicate(0.0),
    "an edge of 1e-9 mm": lambda: with_duplicate(1e-9),
    "slivers of aspect 1e6": lambda: sliver(1e6),
    "a vertex with 300 neighbours": lambda: star(300),
    "4 triangles": tetrahedron,
    "two components": two_components,
    "genus 3": lambda: genus(3),
}


#: Of these no shape is asked: the first is all slivers, 200 times as long as they are wide; a single point of
#: the second is free.
NO_MUSCLES = {"a vertex with 300 neighbours", "4 triangles"}


#: Two bones behind the muscle that it is bent over.
BONES = [box((-10, 16, -70), (10, 26, -5), 100.0), box((-10, 16, 5), (10, 26, 70), 100.0)]
HINGE = (0.0, 21.0, 0.0)


def bending(*angles):
    """Return the transforms of two bones over time, from rest."""
    turned = [rotation_about(HINGE, (1, 0, 0), -angle) for angle in (0.0, *angles)]
    return [np.array([np.eye(4), transform]) for transform in turned]


def run(mesh, path, *, fixed_to=None, bones=BONES, **settings):
    """Return the rest points, the muscle at the end of a path, and the deformer; look at it from outside."""
    points, triangles = mesh
    muscle = arrays.surface_from(points, triangles)
    held = fixed_ends(points) if fixed_to is None else fixed_to
    arrays.add_arrays(muscle, points={"FixedTo": np.asarray(held, dtype=np.int32)})
    tables = {f"bone {k}": np.array([at[k] for at in path]) for k in range(len(bones))}
    rest_bones = arrays.multiblock_from(
        {f"bone {k}": arrays.surface_from(*bone) for k, bone in enumerate(bones)}
    )
    moving = BoneMotion(motion=RigidMotion(np.arange(float(len(path))), tables), bones=rest_bones)
    deformer = PBDDeformer(muscle=muscle, rest_bones=rest_bones, bones=moving, measure_shape=True, **settings)
    with warnings.catch_warnings():
        # A muscle in a bone at rest is told of; any other warning is an error.
        told = r"PBDDeformer: rest_bones, block .*: \d+ of"
        warnings.filterwarnings("ignore", message=told)
        out = deformer.update(time=float(len(path) - 1)).output
    now = arrays.points_of(out)
    assert np.isfinite(now).all()
    if settings.get("quality") == "published":
        assert np.isfinite(arrays.point_array(out, "Velocity", "")).all()
    for k in range(out.GetFieldData().GetNumberOfArrays()):
        array = out.GetFieldData().GetArray(k)
        if array is not None:
            assert np.isfinite(array.GetTuple(0)).all(), array.GetName()
    edges = unique_edges(triangles)
    rest = edge_lengths(points, edges)
    stretch = (edge_lengths(now, edges)[rest > 0] / rest[rest > 0]).max()
    assert np.isclose(figure(out, "EdgeStretchMax"), stretch, rtol=1e-6)
    volume = signed_volume(now, triangles) / signed_volume(points, triangles)
    assert np.isclose(figure(out, "VolumeRatio"), volume, rtol=1e-6, atol=1e-9)
    return now, out


def longest_edge(rest, out):
    """Return the greatest stretch of a muscle's edges, but the short ones; points (n, 3) at rest."""
    edges = unique_edges(arrays.triangles_of(out, "muscle"))
    lengths = edge_lengths(rest, edges)
    long = lengths > SHORT * lengths.mean()
    return float((edge_lengths(arrays.points_of(out), edges)[long] / lengths[long]).max())


def check_shape(rest, out, iterations=ITERATIONS):
    """Check that a muscle, of points (n, 3) at rest, keeps to the bounds of the stable modes."""
    now, topology = arrays.points_of(out), mesh_topology(len(rest), arrays.triangles_of(out, "muscle"))
    angles, before = (np.degrees(np.abs(dihedral_angles(p, topology.quads)[0])) for p in (now, rest))
    folds = int(((angles > 149.0) & (before < 126.0)).sum())
    assert abs(figure(out, "VolumeRatio") - 1.0) <= VOLUME_BOUND
    assert longest_edge(rest, out) <= EDGE_BOUND
    assert folds <= FOLD_BOUND
    assert iterations < ITERATIONS or figure(out, "DihedralErrorP95") <= TURN_BOUND


def figure(out, name):
    return float(arrays.field_array(out, name)[0])
