"""AttachmentEstimator: attachments of a muscle without digitised landmarks."""

from __future__ import annotations

from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.data.attachments import attachments_from
from vtkmuscle.data.estimated_areas import NEAR, estimated_areas
from vtkmuscle.filters.base import Filter, InputPort, OutputPort, Parameter, ports


class AttachmentEstimator(Filter):
    """Propose a muscle's attachments from distances to bones.

    The two ends are the points close to two bones that lie farthest apart along the muscle. An attachment is
    the part of the muscle close to the bone, or inside the bone, in the half of the muscle nearer to the end.
    The smaller attachment is limited to the last quarter of the distance from the larger: muscles arise from
    broad areas, and insert by tendons that slide over bone first. Landmarks are muscle points on the boundary
    of an area.

    Parameters
    ----------
    muscle
        Triangles, in the rest pose.
    bones
        Named blocks of vtkPolyData, at rest.
    distance
        Largest distance between a bone and its attachment; half a muscle edge where half an edge is longer.
    origin
        Name of the origin's bone; None takes the bone of the larger area.
    insertion
        Name of the insertion's bone; None takes the bone of the smaller area.

    Attributes
    ----------
    output
        Attachments: a block per area, a closed polyline through the landmarks, with the field arrays
        ``Bone``, ``Role``, ``Estimated`` (1) and ``Sureness``: 0 where another bone is as likely, 1 where no
        other bone is close.

    Raises
    ------
    ValueError
        If the muscle is close to fewer than two bones, or far from the bones of ``origin`` and ``insertion``;
        if an end is far from any bone, as of a belly whose tendon is a separate surface.

    Limitations
    -----------
    Areas include parts of the muscle that lie on a bone at an end without attachment. Only two areas are
    proposed, on two bones: muscles with several heads need landmarks. Check the areas before use.

    Examples
    --------
    >>> from vtkmuscle.filters import AttachmentEstimator
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> attachments = AttachmentEstimator().apply(muscle, phantom.bones)
    >>> attachments.keys()
    ['origin_0', 'insertion_1']
    """

    distance: Parameter[float] = Parameter(float, default=NEAR, above=0.0, units="mm")
    origin: Parameter[str | None] = Parameter(str, default=None)
    insertion: Parameter[str | None] = Parameter(str, default=None)

    muscle = InputPort(vtkPolyData)
    bones = ports.RestBones()
    output = OutputPort(vtkMultiBlockDataSet)

    def execute(self, muscle: vtkPolyData, bones: dict[str, vtkPolyData]) -> vtkMultiBlockDataSet:
        """Return the areas."""
        areas = estimated_areas(
            muscle, bones, within=self.distance, origin=self.origin, insertion=self.insertion
        )
        return attachments_from(areas)
