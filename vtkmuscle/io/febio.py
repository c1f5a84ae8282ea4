"""Fibre directions for FEBio."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement, indent

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkDataSet

from vtkmuscle.core.errors import InputError
from vtkmuscle.data.arrays import cell_array


def febio_axes(mesh: vtkDataSet, element_set: str) -> Element:
    """Return fibre directions as material axes of a FEBio model.

    The element belongs in the section MeshData. ``a`` is the fibre direction, ``d`` an arbitrary direction
    across. FEBio derives the axes a, (a x d) x a and a x d; transversely isotropic materials use the first.

    Parameters
    ----------
    mesh : vtkDataSet
        With the cell array ``FibreDirection`` (3) of :class:`~vtkmuscle.filters.FibreField`; the cells
        are the elements of the set, in order.
    element_set : str
        Name of the set in the model; in FEBio 4 the name of a domain (``<Elements name="...">``).

    Returns
    -------
    xml.etree.ElementTree.Element
        ``<ElementData type="mat_axis">`` of ``febio_spec`` 4.0; versions 2.5 and 3.0 use ``var`` for
        ``type``.

    Raises
    ------
    ValueError
        If the array is missing, or a cell has no direction.

    References
    ----------
    FEBio User Manual, version 4, section MeshData; Maas et al. 2012, *FEBio: Finite Elements for
    Biomechanics*, doi:10.1115/1.4005694.

    Examples
    --------
    >>> import pyvista as pv
    >>> from xml.etree.ElementTree import tostring
    >>> from vtkmuscle.io import febio_axes
    >>> cell = pv.ImageData(dimensions=(2, 2, 2))
    >>> cell.cell_data["FibreDirection"] = [[0.6, 0.0, 0.8]]
    >>> print(tostring(febio_axes(cell, "muscle"), encoding="unicode"))
    <ElementData type="mat_axis" elem_set="muscle">
      <elem lid="1">
        <a>0.6,0,0.8</a>
        <d>0,1,0</d>
      </elem>
    </ElementData>
    """
    where = "febio_axes: mesh"
    if not mesh.GetCellData().HasArray("FibreDirection"):
        raise InputError(where, "it has no cell array 'FibreDirection'", "FibreField makes it")
    fibres = cell_array(mesh, "FibreDirection", where)
    lengths = np.linalg.norm(fibres, axis=1)
    wrong = np.flatnonzero(~(np.isfinite(lengths) & (lengths > 0.0)))
    if len(wrong):
        raise InputError(where, f"{len(wrong)} cell(s) have no direction, the first is {wrong[0]}")
    across = np.eye(3)[np.abs(fibres).argmin(axis=1)]
    data = Element("ElementData", type="mat_axis", elem_set=element_set)
    for number, axes in enumerate(np.stack([fibres, across], axis=1), start=1):
        element = SubElement(data, "elem", lid=str(number))
        for name, axis in zip("ad", axes, strict=True):
            SubElement(element, name).text = ",".join(f"{x:.9g}" for x in axis)
    indent(data)
    return data
