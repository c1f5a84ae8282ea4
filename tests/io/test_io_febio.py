from xml.etree import ElementTree

import numpy as np
import pytest
import pyvista as pv

from vtkmuscle.io import febio_axes


def mesh_with(directions):
    mesh = pv.ImageData(dimensions=(len(directions) + 1, 2, 2)).cast_to_unstructured_grid()
    mesh.cell_data["FibreDirection"] = np.asarray(directions, dtype=float)
    return mesh


def test_the_first_axis_that_febio_makes_of_them_is_the_fibre(rng):
    """FEBio's FEBioMeshDataSection4: e1 = a, e3 = a x d, e2 = e3 x e1, each made 1 long."""
    directions = np.vstack([np.eye(3), -np.eye(3), rng.normal(size=(50, 3))])
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    data = ElementTree.fromstring(ElementTree.tostring(febio_axes(mesh_with(directions), "belly")))
    assert (data.tag, data.attrib) == ("ElementData", {"type": "mat_axis", "elem_set": "belly"})
    assert [int(element.get("lid")) for element in data] == list(range(1, 57))
    for element, direction in zip(data, directions, strict=True):
        a, d = (np.array(element.find(name).text.split(","), dtype=float) for name in "ad")
        e3 = np.cross(a, d)
        axes = np.array([a, np.cross(e3, a), e3])
        axes /= np.linalg.norm(axes, axis=1)[:, None]
        assert np.abs(axes @ axes.T - np.eye(3)).max() < 1e-8
        assert np.linalg.det(axes) == pytest.approx(1.0)
        assert np.abs(axes[0] - direction).max() < 1e-8


def test_cells_need_directions():
    with pytest.raises(ValueError, match="no cell array 'FibreDirection'; FibreField makes it"):
        febio_axes(pv.ImageData(dimensions=(3, 3, 3)), "belly")
    with pytest.raises(ValueError, match=r"1 cell\(s\) have no direction, the first is 1"):
        febio_axes(mesh_with([[1, 0, 0], [0, 0, 0], [0, 1, 0]]), "belly")
