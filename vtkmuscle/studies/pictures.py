"""A small picture of a muscle at three poses, drawn without OpenGL."""

from __future__ import annotations

import io

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import blocks_of, points_of, polylines_of, triangles_of
from vtkmuscle.run.result import Result

#: Size of the picture [inches at 100 dots each], points of bones that are drawn, and fibres, at most.
_SIZE, _DOTS, _BONE_POINTS, _FIBRES = (3.3, 1.5), 100, 1500, 40
_MUSCLE, _BONE, _FIBRE = np.array([0.78, 0.33, 0.30]), "#b9b4a6", "#8c2d29"


def strip(result: Result, name: str) -> bytes:
    """Return a PNG of a muscle in its first, its middle and its last frame; bones move across the picture.

    The surface is shaded, bones are dots; of model ``"paths"`` the fibres are drawn.
    """
    count = result.finished(name)
    frames = [result.frames[i] for i in ((0, (count - 1) // 2, count - 1) if count else ())]
    figure = Figure(figsize=_SIZE, dpi=_DOTS)
    FigureCanvasAgg(figure)
    across, up, forward = _view(result, name, frames)
    for number, frame in enumerate(frames):
        axes = figure.add_axes((number / 3.0, 0.0, 1.0 / 3.0, 1.0))
        axes.set_axis_off()
        axes.set_aspect("equal")
        bones = _bone_points(result, frame)
        bones = bones[:: max(1, len(bones) // _BONE_POINTS)]
        axes.scatter(bones @ across, bones @ up, s=0.4, c=_BONE, linewidths=0)
        if result.report["model"] == "paths":
            lines = polylines_of(result.fibres(name, frame=frame), "fibres")
            points = lines.points
            fibres = np.split(np.stack([points @ across, points @ up], axis=1), lines.offsets[1:-1])
            axes.add_collection(
                LineCollection(fibres[:: max(1, len(fibres) // _FIBRES)], linewidths=0.5, colors=_FIBRE)
            )
        else:
            surface = result.muscle(name, frame=frame)
            points = points_of(surface)
            axes.add_collection(_shaded(points[triangles_of(surface, name)], across, up, forward))
        middle, half = 0.5 * (points.max(axis=0) + points.min(axis=0)), 0.75 * np.ptp(points, axis=0).max()
        axes.set_xlim(middle @ across - half * 0.75, middle @ across + half * 0.75)
        axes.set_ylim(middle @ up - half, middle @ up + half)
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=_DOTS, metadata={"Software": None})
    return file.getvalue()


def _view(result: Result, name: str, frames: list[int]) -> tuple[Floats, Floats, Floats]:
    """Return the directions across, up and towards the eye: z is up, and bones move in the picture's plane.

    Where none moves sideways, the muscle is seen from where it is widest.
    """
    shape = points_of(result.rest_muscle(name))
    seen = shape[:, :2] - shape[:, :2].mean(axis=0)
    if frames:
        first, last = (_bone_points(result, frame) for frame in (frames[0], frames[-1]))
        moves = (last - first)[:, :2]
        if np.abs(moves).max() > 1e-3 * np.ptp(shape, axis=0).max():
            seen = moves
    _, _, axes = np.linalg.svd(seen, full_matrices=False)
    across = np.array([axes[0, 0], axes[0, 1], 0.0])
    across *= 1.0 if across[np.argmax(np.abs(across))] > 0 else -1.0
    up = np.array([0.0, 0.0, 1.0])
    return across, up, np.cross(across, up)


def _bone_points(result: Result, frame: int) -> Floats:
    return np.concatenate([points_of(bone) for _, bone in blocks_of(result.bones(frame=frame))])


def _shaded(corners: Floats, across: Floats, up: Floats, forward: Floats) -> PolyCollection:
    """Return triangles (m, 3, 3), the nearest last, each as bright as it faces the eye."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = normals @ forward / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
    seen = np.flatnonzero(facing > 0.0)
    order = seen[np.argsort(corners[seen].mean(axis=1) @ forward, kind="stable")]
    flat = np.stack([corners[order] @ across, corners[order] @ up], axis=-1)
    colours = (0.35 + 0.65 * facing[order])[:, None] * _MUSCLE
    return PolyCollection(list(flat), facecolors=colours, edgecolors=colours, linewidths=0.2)
