"""The scene of a page: bones, muscles and fibres in the frames that it shows, packed to be sent."""

from __future__ import annotations

import base64
import gzip
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkQuadricDecimation

from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import points_of, polylines_of, triangles_of
from vtkmuscle.plotting.colours import PALETTE
from vtkmuscle.plotting.views import clearest_view, merged
from vtkmuscle.report.contents import MuscleContent, RunContent
from vtkmuscle.scene.data import MILLIMETRES

#: Steps that the longest side of moving points is cut into: 0.03 mm of half a metre.
STEPS = 20_000

#: Types of arrays by their names in a page.
TYPES = {"u8": np.uint8, "i8": np.int8, "u16": np.uint16, "u32": np.uint32, "f32": np.float32}


class Pack:
    """Arrays one behind the other; a small dict says where each is, and its type.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.report.scene3d import Pack
    >>> pack = Pack()
    >>> pack.add(np.arange(3), "u16")
    {'at': 0, 'count': 3, 'type': 'u16'}
    >>> pack.add(np.ones(2), "f32")
    {'at': 8, 'count': 2, 'type': 'f32'}
    >>> len(pack.text()) > 0
    True
    """

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0

    def add(self, values: Any, kind: str) -> dict[str, Any]:
        """Append an array as one of :data:`TYPES`, and return its position."""
        array = np.ascontiguousarray(np.asarray(values), dtype=TYPES[kind])
        at, padding = self._size, -array.nbytes % 4
        self._parts += [array.tobytes(), bytes(padding)]
        self._size += array.nbytes + padding
        return {"at": at, "count": int(array.size), "type": kind}

    def add_moving(self, frames: Floats) -> dict[str, Any]:
        """Append moving points (f, n, 3), rounded to half a step.

        Coordinates are whole numbers of steps from ``origin``. Each frame is stored as its difference from
        the linear extrapolation of the two before it, low and high bytes apart: most high bytes are zero.
        """
        # The least of numbers one behind the other is found in a tenth of the time.
        each = frames.reshape(-1, 3).T.copy() if frames.size else np.zeros((3, 1))
        low = each.min(axis=1)
        step = max(float((each.max(axis=1) - low).max()), 1e-9) / STEPS
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
    """Return bytes compressed by gzip, in base64; higher levels save 1 to 4 % and take twice the time."""
    return base64.b64encode(gzip.compress(data, 4, mtime=0)).decode("ascii")


#: Frames that a page shows, at most.
MOST_FRAMES = 120
#: Points of all muscles, and of all fibres, over all frames that are shown, at most.
MUSCLE_POINTS, FIBRE_POINTS = 1_000_000, 600_000
#: Triangles that a muscle has at least, and at most.
LEAST, MOST = 600, 12_000
#: Decimals of a bone's transform.
_POSE_DIGITS = 7


def scene_of(run: RunContent, pack: Pack) -> dict[str, Any]:
    """Return the scene of a page, ready for JSON; its arrays are added to the pack.

    It has each bone's surface at rest and its transforms, each muscle's points at rest and per frame, and
    each fibre's points, length, strain and depth in bone per frame.
    """
    shown = shown_frames(len(run.frames))
    scale = MILLIMETRES[run.report["units"]]
    surfaces = run.report["deformer"] != "none"
    count = len(run.muscles)
    budget = MUSCLE_POINTS // max(count * (len(shown) + 1), 1)
    muscles = []
    for number, (name, muscle) in enumerate(run.muscles.items()):
        done = [i for i in shown if i < run.finished(name)]
        muscles.append(
            {
                "name": name,
                "colour": PALETTE[number % len(PALETTE)],
                "surface": _muscle(name, muscle, done, 2 * budget, pack) if surfaces else None,
                "fibres": _fibres(name, muscle, done, FIBRE_POINTS // count, scale, pack),
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
    """Return the positions of the kept frames that a page shows: all, or evenly spread ones."""
    positions = np.linspace(0, count - 1, min(count, MOST_FRAMES)).round()
    return [int(position) for position in np.unique(positions)]


def _bones(run: RunContent, shown: list[int], pack: Pack) -> list[dict[str, Any]]:
    frames = [run.frames[i] for i in shown]
    return [
        {
            "name": name,
            "points": pack.add_moving(bone.points[None]),
            "normals": pack.add(np.rint(127.0 * bone.normals), "i8"),
            "triangles": _indices(bone.triangles, len(bone.points), pack),
            "transforms": _rows(run.motion.transforms.get(name), frames),
        }
        for name, bone in run.bones.by_name.items()
    ]


def _rows(transforms: Floats | None, frames: list[int]) -> list[float] | None:
    """Return the first three rows of a bone's transforms in some frames, None where it stays at rest."""
    if transforms is None or np.allclose(transforms[frames], np.eye(4)):
        return None
    return [round(float(value), _POSE_DIGITS) for value in transforms[frames][:, :3].ravel()]


def _muscle(
    name: str, muscle: MuscleContent, done: list[int], wanted: int, pack: Pack
) -> dict[str, Any] | None:
    rest = muscle.rest
    points, triangles = points_of(rest), triangles_of(rest, name)
    kept = np.arange(len(points))
    wanted = min(max(wanted, LEAST), MOST)
    if len(triangles) > wanted:
        kept, triangles = _decimated(rest, points, wanted)
    moved = [points[kept], *(points_of(muscle.surfaces[i])[kept] for i in done)]
    return {
        "points": pack.add_moving(np.array(moved)),
        "triangles": _indices(triangles, len(kept), pack),
        "whole": len(points_of(rest)),
    }


def _decimated(surface: vtkPolyData, points: Floats, wanted: int) -> tuple[Ints, Ints]:
    """Return which points of a surface are kept, and triangles of these."""
    decimation = vtkQuadricDecimation()
    decimation.SetInputData(surface)
    decimation.SetTargetReduction(1.0 - wanted / surface.GetNumberOfCells())
    decimation.Update()
    coarse = decimation.GetOutput()
    _, nearest = cKDTree(points).query(points_of(coarse))
    kept, place = np.unique(nearest, return_inverse=True)
    triangles = place.reshape(-1)[triangles_of(coarse, "muscle")]
    a, b, c = triangles.T
    return kept, triangles[(a != b) & (b != c) & (c != a)]


def _fibres(
    name: str, muscle: MuscleContent, done: list[int], budget: int, scale: float, pack: Pack
) -> dict[str, Any] | None:
    if muscle.fibre_lengths is None or not done:
        return None
    first = polylines_of(muscle.fibres[done[0]], name)
    count = len(first.offsets) - 1
    every = max(1, -(-len(first.points) * len(done) // max(budget, 1)))
    chosen = np.arange(0, count, every)
    ids = np.concatenate([np.arange(first.offsets[k], first.offsets[k + 1]) for k in chosen])
    sizes = np.diff(first.offsets)[chosen]
    points: list[Floats] = []
    measures: dict[str, list[Floats]] = {"strain": [], "depth": []}
    for i in done:
        lines = muscle.fibres[i]
        points.append(points_of(lines)[ids])
        for word, array, factor in (("strain", "Strain", 100.0), ("depth", "Penetration", scale)):
            values = lines.GetCellData().GetArray(array)
            if values is not None:
                measures[word].append(factor * np.asarray(values)[chosen])
    lengths = muscle.fibre_lengths[done]
    return {
        "points": pack.add_moving(np.array(points)),
        "sizes": pack.add(sizes, "u16"),
        "count": len(chosen),
        "all": count,
        "length": pack.add(lengths[:, chosen], "f32"),
        **{
            word: pack.add(np.array(rows), "f32") for word, rows in measures.items() if len(rows) == len(done)
        },
    }


def _view(run: RunContent) -> dict[str, Any]:
    """Return from where most of the muscles is seen, at rest."""
    muscles = merged(muscle.rest for muscle in run.muscles.values())
    view = clearest_view([muscles], [run.bones.spread()])
    return {"towards": [float(value) for value in view.direction]}


def _indices(triangles: Ints, n_points: int, pack: Pack) -> dict[str, Any]:
    return pack.add(triangles, "u16" if n_points <= 65_535 else "u32")
