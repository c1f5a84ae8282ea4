"""The data of a run's page: its scene as packed arrays, and curves over the motion."""

import base64
import gzip
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.moment_arms.of_joints import JointArms
from vtkmuscle.core.motion.coordinates import ANGLES, MILLIMETRES
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data import toml_table
from vtkmuscle.data.arrays import points_of, polylines_of, triangles_of
from vtkmuscle.data.label_images import decimated
from vtkmuscle.io.literature import LiteratureCurve, curves_for, drawn_curves, label_of
from vtkmuscle.plotting.views import LEAST_TRIANGLES, PALETTE, DrawnBones, clearest_view, merged

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
        sizes = {"frames": len(frames), "points": frames.shape[1], "origin": low.tolist(), "step": step}
        return sizes | {"low": self.add(folded & 255, "u8"), "high": self.add(folded >> 8, "u16")}

    def text(self) -> str:
        """Return all arrays, compressed by gzip, in base64."""
        # Higher levels save 1 to 4 % and take twice the time.
        return base64.b64encode(gzip.compress(b"".join(self._parts), 4, mtime=0)).decode("ascii")


#: Frames, and single fibres of a muscle, on a page, at most: pixels of a curve are about as many.
MOST_SHOWN = 120
#: Points of all muscles, and of all fibres, in all frames of a page, at most.
POINTS = 1_000_000
#: Largest number of triangles per muscle.
MOST = 12_000


def scene_of(run: "Result", pack: Pack) -> dict[str, Any]:
    """Return the scene of a page, ready for JSON, and add its arrays to the pack."""
    shown = shown_of(len(run.frames))
    scale = MILLIMETRES[run.report["units"]]
    surfaces = run.report["deformer"] != "none"
    count = len(run.muscle_names)
    budget = POINTS // max(count * (len(shown) + 1), 1)
    muscles = []
    for number, name in enumerate(run.muscle_names):
        done = [i for i in shown if i < run.finished(name)]
        rest, moved = run.track(name).rest, run.track(name).surfaces
        frames = (points_of(moved[i]) for i in done)
        surface = packed_surface(rest, frames, 2 * budget, pack) if surfaces else None
        fibres = _fibres(run, name, done, POINTS // count, scale, pack)
        muscles.append({"name": name, "colour": colour_of(number), "surface": surface, "fibres": fibres})
    whole = merged(run.track(name).rest for name in run.muscle_names)
    view = {"towards": clearest_view([whole], [run.drawn_bones.spread()]).direction.tolist()}
    bones = packed_bones(run.drawn_bones, pack, run.motion.transforms, [run.frames[i] for i in shown])
    return {"shown": shown, "mm": scale, "bones": bones, "muscles": muscles, "view": view}


def shown_of(count: int) -> list[int]:
    """Return evenly spread indices of frames or fibres."""
    positions = np.linspace(0, count - 1, min(count, MOST_SHOWN)).round()
    return [int(position) for position in np.unique(positions)]


def packed_bones(
    bones: DrawnBones, pack: Pack, transforms: Mapping[str, Floats] | None = None, frames: Sequence[int] = ()
) -> list[dict[str, Any]]:
    """Return bones of a page, at rest or moved in frames."""
    result = []
    for name, bone in bones.by_name.items():
        arrays = {"name": name, "points": pack.add_moving(bone.points[None])}
        arrays["normals"] = pack.add(np.rint(127.0 * bone.normals), "i8")
        arrays["triangles"] = _indices(bone.triangles, len(bone.points), pack)
        result.append(arrays | {"transforms": _rows((transforms or {}).get(name), frames)})
    return result


def _rows(transforms: Floats | None, frames: Sequence[int]) -> list[float] | None:
    """Return 3 rows of each bone transform, None at rest."""
    if transforms is None or np.allclose(transforms[frames], np.eye(4)):
        return None
    return [round(float(value), 7) for value in transforms[frames][:, :3].ravel()]


def packed_surface(rest: vtkPolyData, frames: Iterable[Floats], target: int, pack: Pack) -> dict[str, Any]:
    """Return a muscle of a page. Points (n, 3) of frames; about `target` triangles."""
    points, triangles = points_of(rest), triangles_of(rest, "muscle")
    chosen = np.arange(len(points))
    target = min(max(target, LEAST_TRIANGLES), MOST)
    if len(triangles) > target:
        chosen, triangles = _thinned(points, triangles, target)
    moved = np.array([points[chosen], *(frame[chosen] for frame in frames)])
    indices = _indices(triangles, len(chosen), pack)
    return {"points": pack.add_moving(moved), "triangles": indices, "whole": len(points)}


def packed_lines(points: Floats, sizes: Ints, pack: Pack) -> dict[str, Any]:
    """Return polylines of a page. Points (f, n, 3), and numbers of points."""
    moved = pack.add_moving(points)
    return {"points": moved, "sizes": pack.add(sizes, "u16"), "count": len(sizes)}


def _thinned(points: Floats, triangles: Ints, target: int) -> tuple[Ints, Ints]:
    """Return kept points of a surface, and their triangles."""
    coarse, coarse_triangles = decimated(points, triangles, target)
    chosen, index = np.unique(cKDTree(points).query(coarse)[1], return_inverse=True)
    triangles = index[coarse_triangles]
    return chosen, triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]


def _fibres(
    run: "Result", name: str, done: list[int], budget: int, scale: float, pack: Pack
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
        **packed_lines(np.array(points), sizes, pack),
        "all": count,
        "length": pack.add(lengths[done][:, chosen], "f32"),
        **{key: pack.add(rows, "f32") for key, rows in measures.items() if len(rows) == len(done)},
    }


def _indices(triangles: Ints, n_points: int, pack: Pack) -> dict[str, Any]:
    return pack.add(triangles, "u16" if n_points <= 65_535 else "u32")


#: Change of a measure, relative to its limit, below which words replace the curve: a twentieth of a pixel.
_FLAT = 1e-3
#: Minus sign of negative numbers.
MINUS = "\u2212"


class Measure(NamedTuple):
    """A shape measure on a page. Key in the rows, check with the limits, titles of curve and column.

    ``factor`` times the value plus ``offset`` has the unit of the limits; ``of_all`` names the function of
    NumPy that gives the value in the table from the sizes in all frames.
    """

    key: str
    check: str = ""
    curve: str = ""
    head: str = ""
    factor: float = 1.0
    offset: float = 0.0
    of_all: str = "max"

    def of(self, frames: Iterable[Mapping[str, Any]]) -> Floats:
        """Return the values of frames in the limits' unit; NaN for a missing value."""
        values = np.array([row.get(self.key) for row in frames], dtype=np.float64)  # None is NaN
        return self.factor * values + self.offset


#: Titles and factors of quantities on a page.
QUANTITIES = toml_table("vtkmuscle.report", "quantities.toml")
#: Measures on a page.
MEASURES = tuple(Measure(**row) for row in QUANTITIES["measures"])


def curves_of(run: "Result", pack: Pack) -> dict[str, Any]:
    """Return the curves of a page, ready for JSON. Single fibres are added to the pack."""
    time_name, _, unit = run.time_label.partition(" [")
    muscles = [_curves(run, name, colour_of(index), pack) for index, name in enumerate(run.muscle_names)]
    shown = [each for each in MEASURES if any(each.key in muscle["checks"] for muscle in muscles)]
    return {
        "times": [*run.times],  # five digits of an absolute time would be the same in all frames
        "timeLabel": run.time_label,
        "timeName": time_name,
        "timeUnit": f" {unit.removesuffix(']')}".rstrip(),
        "muscles": muscles,
        "coordinates": list(_coordinates(run)),
        "checks": [_check(run, measure, run.limits.get(measure.check)) for measure in shown],
    }


def rounded(values: Any) -> Any:
    """Return numbers to five digits, as lists; None for non-finite numbers."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim > 1:
        return [rounded(row) for row in array]
    return [float(f"{value:.5g}") if math.isfinite(value) else None for value in array.tolist()]


def colour_of(index: int) -> str:
    """Return a muscle's colour by its index."""
    return PALETTE[index % len(PALETTE)]


def _curves(run: "Result", name: str, colour: str, pack: Pack) -> dict[str, Any]:
    checks, frames = {}, run.report["muscles"][name]["frames"]
    for measure in MEASURES:
        values = measure.of(frames)
        if measure.curve and not np.isnan(values).all():
            checks[measure.key] = rounded(np.where(np.abs(values) < 1e-9, 0.0, values))
    lengths, fibres, arms = run.lengths.get(name), run.fibre_lengths.get(name), run.all_arms.get(name, {})
    published = {axis: curves_for(run.published_arms(name), coordinate=axis) for axis in arms}
    return {
        "name": name,
        "label": label_of(name),
        "colour": colour,
        "lengths": None if lengths is None else _lengths(lengths, pack, run.track(name).errors()["total"]),
        "fibreLengths": None if fibres is None else _lengths(fibres, pack),
        "arms": {axis: _arms(joint, published[axis]) for axis, joint in arms.items()},
        "checks": checks,
    }


def _lengths(lengths: Floats, pack: Pack, error: Floats | float = np.nan) -> dict[str, Any]:
    quartiles = rounded(np.percentile(lengths, (25.0, 75.0), axis=1))
    drawn = shown_of(lengths.shape[1])
    sides = dict(zip(("lower", "upper"), quartiles, strict=True))
    fibres = pack.add(lengths[:, drawn], "f32")
    return {**_band(lengths, error), **sides, "fibres": fibres, "drawn": len(drawn)}


def _band(values: Floats, error: Any, drawn: Callable[[Floats], Floats] = np.asarray) -> dict[str, Any]:
    """Return mean, range, and mean with error, of values (f, k)."""
    mean = values.mean(axis=1)
    rows = {"mean": mean, "low": values.min(axis=1), "high": values.max(axis=1)}
    held = rounded([drawn(mean - error), drawn(mean + error)])
    return {key: rounded(drawn(row)) for key, row in rows.items()} | {"held": held}


def _arms(arms: JointArms, published: Sequence[LiteratureCurve]) -> dict[str, Any]:
    # A sweep up and down repeats values: curves are drawn by ascending value. Gaps have the pose before.
    poses, unit = arms.drawn(np.c_[arms.values, arms.frames]), ANGLES.get(arms.unit)
    gaps = np.flatnonzero(np.isnan(poses[:, 0]))
    poses[gaps] = poses[gaps - 1]
    return {
        "values": rounded(poses[:, 0]),
        "frames": rounded(poses[:, 1]),
        **_band(arms.arms, arms.errors["total"], arms.drawn),
        "quartic": None if arms.quartic is None else rounded(arms.drawn(arms.quartic.mean(axis=1))),
        "literature": [] if unit is None else list(published_curves(published, math.pi / 180.0 / unit)),
    }


def published_curves(curves: Sequence[LiteratureCurve], per_degree: float) -> Iterator[dict[str, Any]]:
    """Yield published curves: bands, lines or single values."""
    colours: dict[str, str] = {}
    for curve in drawn_curves(curves):
        colour = colours.setdefault(curve.source, PALETTE[-1 - len(colours) % len(PALETTE)])
        sides = {"y": curve.arms} if curve.upper is None else {"low": curve.arms, "high": curve.upper}
        columns = {"x": curve.angles * per_degree, **sides}
        rows = {key: rounded(column) for key, column in columns.items()}
        yield {"colour": colour, "label": curve.label} | rows


def _coordinates(run: "Result") -> Iterator[dict[str, Any]]:
    """Yield the coordinates of moment arms, with values."""
    for name in dict.fromkeys(name for arms in run.all_arms.values() for name in arms):
        own = run.motion.coordinates[name]
        words = {"name": name, "label": label_of(name), "unit": own.unit, "positive": own.positive}
        values = rounded(np.asarray(own.values)[list(run.frames)])
        of = "mm" if own.unit in ANGLES else "1"
        yield words | {"axis": label_of(name, own.unit), "of": of, "values": values}


def _check(run: "Result", measure: Measure, limit: tuple[float, float] | None) -> dict[str, Any]:
    """Return title, limits and words of a measure."""
    every = [measure.of(run.report["muscles"][name]["frames"]) for name in run.muscle_names]
    values = (together := np.concatenate(every))[~np.isnan(together)]
    look, failed = limit or (None, None)
    flat = None
    if look is not None and len(values) and np.ptp(values) <= _FLAT * abs(look):
        ends = dict.fromkeys(f"{value:.2g}".replace("-", MINUS) for value in (values.min(), values.max()))
        flat = f"{' to '.join(ends)} in all frames of all muscles; to be checked from {look:g} on."
    floor = look and ([-look, look] if measure.check == "volume" else [look])
    check = {"key": measure.key, "label": measure.curve, "flat": flat, "look": look}
    return check | {"failed": failed, "floor": floor}
