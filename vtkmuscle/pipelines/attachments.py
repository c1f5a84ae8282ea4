"""Attachments of a muscle for which there are no landmarks."""

from __future__ import annotations

from typing import Any

from vtkmuscle.filters.attachment_estimator import AttachmentEstimator
from vtkmuscle.pipelines.connecting import connected


def estimate_attachments(
    muscle: Any, bones: Any, *, tolerance: float | None = None, origin: str | None = None
) -> Any:
    """Return attachments of a muscle for which there are no landmarks, from where it touches the bones.

    Parameters
    ----------
    muscle : vtkPolyData or algorithm
        Surface of triangles, in the rest pose.
    bones : vtkMultiBlockDataSet or algorithm
        Named blocks, in the rest pose.
    tolerance, origin
        Of AttachmentEstimator, which says how they are found and what they are good for.

    Returns
    -------
    vtkMultiBlockDataSet
        What :func:`decompose` and :func:`deform` take as attachments; each block has the field array
        ``Estimated``, which is 1.

    Raises
    ------
    ValueError
        If the muscle touches fewer than two bones.

    Examples
    --------
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> from vtkmuscle.pipelines import deform, estimate_attachments
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> attachments = estimate_attachments(muscle, phantom.bones)
    >>> chain = deform(muscle, phantom.bones, phantom.motion, attachments, iterations=3)
    >>> float(chain.update(time=0.0).output.GetFieldData().GetArray("VolumeRatio").GetValue(0))
    1.0
    """
    estimator = AttachmentEstimator(tolerance=tolerance, origin=origin)
    return connected(estimator, muscle=muscle, bones=bones).update().output
