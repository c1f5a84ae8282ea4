"""The scene of a run's page as packed arrays."""

from __future__ import annotations

import base64
import gzip
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import cKDTree

from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import points_of, polylines_of, triangles_of
from vtkmuscle.data.isosurface import decimated
from vtkmuscle.plotting.views import PALETTE, clearest_view, merged
from vtkmuscle.scene.data import MILLIMETRES

if TYPE_CHECKING:
    from vtkmuscle.run.result import Result


#: Steps along the longest side of moving points: 0.03 mm for 0.5 m.
STEPS = 20_000

#: Types of arrays by name in a page.
TYPES = {"u8": np.uint8, "i8": np.int8, "u16": np.uint16, "u32": np.uint32, "f32": np.float32}


class Pack:
    """Arrays in sequence, found by position and type."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0

    def add(self, values: Any, kind: str) -> dict[str, Any]:
        """Append an array of a known type; return its position. Types are in :data:`TYPES`."""
        array = np.ascontiguousarray(np.asarray(values), dtype=TYPES[kind])
        at, padding = self._size, -array.nbytes % 4
        self._parts += [array.tobytes(), bytes(padding)]
        self._size += array.nbytes + padding
        return {"at": at, "count": int(array.size), "type": kind}

    def add_moving(self, frames: Floats) -> dict[str, Any]:
        """Append moving points (f, n, 3), rounded to half a step.

        Coordinates are integers in steps from ``origin``. A frame is stored as its difference from the linear
        extrapolation of the previous two frames, low and high bytes apart, because most high bytes are zero.
        """
        # The minimum of contiguous numbers takes a tenth of the time.
        columns = frames.reshape(-1, 3).T.copy() if frames.size else np.zeros((3, 1))
        low = columns.min(axis=1)
        step = max(float((columns.max(axis=1) - low).max()), 1e-9) / STEPS
        whole = np.rint((frames - low) / step).astype(np.int32)
        differences = whole.copy()
        differences[1:] -= whole[:-1]
        differences[2:] -= whole[1:-1] - whole[:-2]
        folded = ((differences << 1) ^ (differences >> 31)).astype(np.uint32)
        low_bytes, high_bytes = (folded & 255).astype(np.uint8), (folded >> 8).astype(np.uint16)
        return {
            "frames": len(frames),
            "points": int(frames.shape[1]),
            "origin": [float(value) for value in low],
            "step": step,
            "low": self.add(low_bytes, "u8"),
            "high": self.add(high_bytes, "u16"),
        }

    def text(self) -> str:
        """Return all arrays, compressed by gzip, in base64."""
        return packed(b"".join(self._parts))


def packed(data: bytes) -> str:
    """Return bytes compressed by gzip, in base64. Higher levels save 1 to 4 % and take twice the time."""
    return base64.b64encode(gzip.compress(data, 4, mtime=0)).decode("ascii")


#: Frames on a page, at most.
MOST_FRAMES = 120
#: Points of all muscles, and of all fibres, in all frames of a page, at most.
MUSCLE_POINTS, FIBRE_POINTS = 1_000_000, 600_000
#: Least and largest number of triangles per muscle.
LEAST, MOST = 600, 12_000


def scene_of(run: Result, pack: Pack) -> dict[str, Any]:
    """Return the scene of a page, ready for JSON, and add its arrays to the pack.

    The scene has bone surfaces at rest and their transforms; muscle points at rest and per frame; and points,
    length, strain and depth in bone of fibres per frame.
    """
    shown = shown_frames(len(run.frames))
    scale = MILLIMETRES[run.report["units"]]
    surfaces = run.report["deformer"] != "none"
    count = len(run.muscle_names)
    budget = MUSCLE_POINTS // max(count * (len(shown) + 1), 1)
    muscles = []
    for number, name in enumerate(run.muscle_names):
        done = [i for i in shown if i < run.finished(name)]
        muscles.append(
            {
                "name": name,
                "colour": PALETTE[number % len(PALETTE)],
                "surface": _muscle(run, name, done, 2 * budget, pack) if surfaces else None,
                "fibres": _fibres(run, name, done, FIBRE_POINTS // count, scale, pack),
            }
        )
    return {
        "shown": shown,
        "mm": scale,
        "bones": _bones(run, shown, pack),
        "muscles": muscles,
        "view": _view(run),
    }


def shown_frames(count: int) -> list[int]:
    """Return evenly spread indices of kept frames."""
    positions = np.linspace(0, count - 1, min(count, MOST_FRAMES)).round()
    return [int(position) for position in np.unique(positions)]


def _bones(run: Result, shown: list[int], pack: Pack) -> list[dict[str, Any]]:
    frames = [run.frames[i] for i in shown]
    return [
        {
            "name": name,
            "points": pack.add_moving(bone.points[None]),
            "normals": pack.add(np.rint(127.0 * bone.normals), "i8"),
            "triangles": _indices(bone.triangles, len(bone.points), pack),
            "transforms": _rows(run.motion.transforms.get(name), frames),
        }
        for name, bone in run.drawn_bones.by_name.items()
    ]


def _rows(transforms: Floats | None, frames: list[int]) -> list[float] | None:
    """Return 3 rows of each bone transform, None at rest."""
    if transforms is None or np.allclose(transforms[frames], np.eye(4)):
        return None
    return [round(float(value), 7) for value in transforms[frames][:, :3].ravel()]


def _muscle(run: Result, name: str, done: list[int], target: int, pack: Pack) -> dict[str, Any] | None:
    rest, surfaces = run.rest_muscle(name), run.track(name).surfaces
    points, triangles = points_of(rest), triangles_of(rest, name)
    chosen = np.arange(len(points))
    target = min(max(target, LEAST), MOST)
    if len(triangles) > target:
        chosen, triangles = _thinned(points, triangles, target)
    moved = [points[chosen], *(points_of(surfaces[i])[chosen] for i in done)]
    return {
        "points": pack.add_moving(np.array(moved)),
        "triangles": _indices(triangles, len(chosen), pack),
        "whole": len(points_of(rest)),
    }


def _thinned(points: Floats, triangles: Ints, target: int) -> tuple[Ints, Ints]:
    """Return kept points of a surface, and their triangles."""
    coarse, coarse_triangles = decimated(points, triangles, target)
    chosen, index = np.unique(cKDTree(points).query(coarse)[1], return_inverse=True)
    triangles = index[coarse_triangles]
    a, b, c = triangles.T
    return chosen, triangles[(a != b) & (b != c) & (c != a)]


def _fibres(
    run: Result, name: str, done: list[int], budget: int, scale: float, pack: Pack
) -> dict[str, Any] | None:
    lengths, fibres = run.fibre_lengths.get(name), run.track(name).fibres
    if lengths is None or not done:
        return None
    first = polylines_of(fibres[done[0]], name)
    count = len(first.offsets) - 1
    every = max(1, -(-len(first.points) * len(done) // max(budget, 1)))
    chosen = np.arange(0, count, every)
    ids = np.concatenate([np.arange(first.offsets[k], first.offsets[k + 1]) for k in chosen])
    sizes = np.diff(first.offsets)[chosen]
    points: list[Floats] = []
    measures: dict[str, list[Floats]] = {"strain": [], "depth": []}
    for lines in (fibres[i] for i in done):
        points.append(points_of(lines)[ids])
        for key, array, factor in (("strain", "Strain", 100.0), ("depth", "Penetration", scale)):
            values = lines.GetCellData().GetArray(array)
            measures[key] += [] if values is None else [factor * np.asarray(values)[chosen]]
    return {
        "points": pack.add_moving(np.array(points)),
        "sizes": pack.add(sizes, "u16"),
        "count": len(chosen),
        "all": count,
        "length": pack.add(lengths[done][:, chosen], "f32"),
        **{key: pack.add(rows, "f32") for key, rows in measures.items() if len(rows) == len(done)},
    }


def _view(run: Result) -> dict[str, Any]:
    """Return the view with the largest visible muscle area."""
    muscles = merged(map(run.rest_muscle, run.muscle_names))
    view = clearest_view([muscles], [run.drawn_bones.spread()])
    return {"towards": [float(value) for value in view.direction]}


def _indices(triangles: Ints, n_points: int, pack: Pack) -> dict[str, Any]:
    return pack.add(triangles, "u16" if n_points <= 65_535 else "u32")
