"""AttachmentEstimator: attachments of a muscle without digitised landmarks."""

from __future__ import annotations

from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.data.attachments import attachments_from
from vtkmuscle.data.estimated_areas import NEAR, estimated_areas
from vtkmuscle.filters.base import Filter, InputPort, OutputPort, Parameter, ports


class AttachmentEstimator(Filter):
    """Propose the attachments of a muscle, from where its ends are near the bones at rest.

    The ends are the two points near two bones that are farthest apart along the muscle; bones that it passes
    are between them. An attachment is the part of the muscle near its bone, or inside of it, in the half that
    is nearer to its end. The smaller one is limited to the last quarter of the way from the larger: muscles
    arise from broad areas, and insert by tendons that slide over bone before. The landmarks are points of the
    muscle on the areas' boundaries. ``origin`` and ``insertion`` name the bones where they are known.

    The areas are a start where landmarks are missing, no replacement: parts of the muscle that lie on a bone
    at an end without being attached to it are included. Look at the areas before you rely on them.

    Parameters
    ----------
    muscle
        Triangles, in the rest pose.
    bones
        Named blocks of vtkPolyData, at rest.
    distance
        Distance up to which a point is near a bone; half an edge of the muscle where that is more.
    origin
        Name of the origin's bone; None is the bone of the larger area.
    insertion
        Name of the insertion's bone; None is the bone of the smaller area.

    Attributes
    ----------
    output
        Attachments: a block per area, a closed polyline through its landmarks, with the field arrays
        ``Bone``, ``Role``, ``Estimated`` (1) and ``Sureness``: 0 where the muscle is as likely attached to
        another bone, 1 where no other is near.

    Raises
    ------
    ValueError
        If the muscle is near fewer than two bones, or far from those of ``origin`` and ``insertion``; if one
        of its ends is far from any bone, as that of a belly whose tendon is another surface.

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
