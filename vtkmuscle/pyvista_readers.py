"""Readers for ``pyvista.read``, through the entry point group ``pyvista.readers``.

They are for trees of MAF (``.msf``, ``.nms``), and for scenes where the caller says so: PyVista goes by the
last suffix of a name, and ``.toml`` is used by many.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista

from vtkmuscle.data.arrays import multiblock_from
from vtkmuscle.io.msf import landmarks_of, read_msf, surfaces_of
from vtkmuscle.scenes import Scene


def read_scene_file(path: str, **_: Any) -> Any:
    """Return the bones, muscles and attachments of a scene.toml, at rest.

    ``pyvista.read("scene.toml", force_ext=".scene.toml")`` calls it.

    Parameters
    ----------
    path : str
        The scene.

    Returns
    -------
    pyvista.MultiBlock
        The blocks ``bones``, ``muscles`` and ``attachments``, each with a block per name; in the last a block
        per muscle has a block per area.

    Raises
    ------
    SceneError
        If it cannot be read; the message names the key.
    """
    scene = Scene.load(path)
    muscles = {name: muscle.surface for name, muscle in scene.muscles.items()}
    attachments = {name: scene.attachments_data(name) for name in scene.muscles}
    blocks = {
        "bones": scene.bones_data(),
        "muscles": multiblock_from(muscles),
        "attachments": multiblock_from(attachments),
    }
    return pyvista.wrap(multiblock_from(blocks))


def read_tree_file(path: str, **_: Any) -> Any:
    """Return the surfaces and the landmarks of a tree of MAF or ALBA, at the first time of each.

    Parameters
    ----------
    path : str
        A .msf or .nms file; see :mod:`vtkmuscle.io.msf`.

    Returns
    -------
    pyvista.MultiBlock
        The blocks ``surfaces``, a block per name, and ``landmarks``, a block of points per cloud, with their
        names in the field array ``Names``; all in the frame of the tree.

    Raises
    ------
    ValueError
        If it cannot be read.
    """
    root = read_msf(path)
    clouds = {}
    for name, points in landmarks_of(root).items():
        clouds[name] = pyvista.PolyData(np.reshape(list(points.values()), (-1, 3)))
        clouds[name].field_data["Names"] = np.array(list(points), dtype=str)
    blocks = {"surfaces": multiblock_from(surfaces_of(root)), "landmarks": multiblock_from(clouds)}
    return pyvista.wrap(multiblock_from(blocks))
