"""LabelSurfaces: closed surfaces of the labels of a segmentation."""

from __future__ import annotations

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.words import suggestion
from vtkmuscle.data.arrays import multiblock_from, set_field_array, surface_from
from vtkmuscle.data.isosurface import label_surface
from vtkmuscle.data.label_images import LabelField, labels_in
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.base.ports import InputPort, OutputPort

#: Of the phantom hip at voxels of 1.5 mm 95 % of the surface is then within 0.34 mm of the true one, of a
#: rough label 0.46; with 0.5 within 0.35 and 0.52, with 1.0 0.42 and 0.50 (benchmarks/bench_labels.py).
SMOOTHING = 0.7


class LabelSurfaces(Filter):
    """Turn each label of an image into a surface: closed, manifold, of the label's volume.

    The signed distance from the label, smoothed by a Gaussian, has a level within which there are as many
    voxels as the label has. That level is contoured, its triangles are made even and fewer, and moved along
    their normals by the little that is still missing of the volume. Voxels may be longer one way than
    another, and stand askew in the world.

    Of a label in several pieces the largest is taken, and hollows are filled; what was left out and added,
    and where the image's border cuts a label, is in the surface's field arrays.

    Parameters
    ----------
    image
        Point scalars of whole numbers, 0 where there is no label; optional field arrays ``LabelValues`` and
        ``LabelNames``, of the same length.
    labels
        Names of labels, with commas between them; None takes all.
    smoothing
        Standard deviation of the Gaussian.
    edge
        Length of the triangles' edges; where voxels are larger, about theirs.

    Attributes
    ----------
    output
        A block per label, by its name (``label_7`` where it has none), in the image's world, with the field
        arrays ``Label``, ``LabelVolume`` (of the label [mm^3]), ``VolumeError`` (of the surface, as a part of
        it), ``BoundaryDistance`` (mean, 95th percentile and maximum over the points, from the label's
        boundary [mm]), ``Pieces``, ``LeftOut`` (voxels of the other pieces, as a part of all), ``Filled``
        (voxels of hollows) and ``Cut`` (voxels at the image's border). A label that has no closed manifold
        surface is an empty block, with the reason in ``Refused``.

    Raises
    ------
    ValueError
        If the image has no array of whole numbers, or no label; if there is no such label as one of
        ``labels``.

    References
    ----------
    Maurer, Qi, Raghavan 2003, *A linear time algorithm for computing exact Euclidean distance transforms*,
    doi:10.1109/TPAMI.2003.1177156; Garland, Heckbert 1997, *Surface simplification using quadric error
    metrics*, doi:10.1145/258734.258849.

    Examples
    --------
    >>> from vtkmuscle.filters import LabelSurfaces
    >>> from vtkmuscle.phantoms import label_map, spindle_over_hinge
    >>> surfaces = LabelSurfaces()(label_map(spindle_over_hinge(), spacing=4.0))
    >>> [surfaces.GetMetaData(i).Get(surfaces.NAME()) for i in range(3)]
    ['proximal', 'distal', 'spindle']
    """

    labels: Parameter[str | None] = Parameter(str, default=None)
    smoothing = Parameter(float, default=SMOOTHING, minimum=0.0, maximum=4.0, units="voxels")
    edge = Parameter(float, default=3.0, above=0.0, units="mm")

    image = InputPort(vtkImageData)
    output = OutputPort(vtkMultiBlockDataSet)

    def execute(self, image: vtkImageData) -> vtkMultiBlockDataSet:
        """Return the surfaces."""
        found = labels_in(image, "LabelSurfaces: image")
        wanted = list(found) if self.labels is None else [name.strip() for name in self.labels.split(",")]
        blocks = {}
        for number, name in enumerate(wanted):
            self.report_progress(number / len(wanted))
            if name not in found:
                remedy = suggestion(name, found)
                raise InputError("LabelSurfaces: labels", f"there is no label {name!r}", remedy)
            blocks[name] = _surface(found[name].field(self.smoothing), self.edge)
            set_field_array(blocks[name], "Label", found[name].value)
        return multiblock_from(blocks)


def _surface(field: LabelField, edge: float) -> vtkPolyData:
    """Return the surface of a label, with what it is like; an empty one, with the reason, without it."""
    try:
        points, triangles = label_surface(field, edge)
    except InputError as error:
        points, triangles = np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
        surface = surface_from(points, triangles)
        set_field_array(surface, "Refused", str(error))
    else:
        surface = surface_from(points, triangles)
        away = np.abs(field.distances_from_boundary(points))
        set_field_array(surface, "VolumeError", signed_volume(points, triangles) / field.volume - 1.0)
        distances = [float(away.mean()), float(np.percentile(away, 95)), float(away.max())]
        set_field_array(surface, "BoundaryDistance", np.array(distances))
    set_field_array(surface, "LabelVolume", field.volume)
    set_field_array(surface, "Pieces", len(field.pieces))
    set_field_array(surface, "LeftOut", 1.0 - float(field.pieces[0] / field.pieces.sum()))
    set_field_array(surface, "Filled", field.filled)
    set_field_array(surface, "Cut", field.cut)
    return surface
