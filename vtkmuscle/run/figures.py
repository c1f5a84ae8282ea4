"""Pictures: the figures of a run, scenes and results on a plotter, films."""

import math
import time
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import names
from vtkmuscle.data.arrays import blocks_of, points_of, with_points
from vtkmuscle.io.literature import label_of
from vtkmuscle.plotting.drawing import FigureOrder, can_render
from vtkmuscle.plotting.views import DrawnBones, MuscleFrame, fibre_surface
from vtkmuscle.run.result_data import UNNAMED
from vtkmuscle.scene.data import SceneData

if TYPE_CHECKING:
    from vtkmuscle.run.pool import Pool
    from vtkmuscle.run.result import Result

#: Formats of figures.
FORMS = ("png", "pdf", "svg")


class Drawing:
    """The figures of a run in a folder, drawn by a pool."""

    def __init__(self, folder: Path, pool: "Pool | None", bones: DrawnBones) -> None:
        self._folder, self._pool, self._bones, self._orders = folder, pool, bones, list[FigureOrder]()
        self._jobs: list[Future[float]] = []

    def add(self, orders: list[FigureOrder]) -> None:
        """Add figures, unless no picture can be rendered here."""
        if can_render() is not None:
            return
        self._orders += orders
        if self._pool is not None:
            with suppress(BrokenProcessPool):  # the earlier figures tell
                self._jobs += [self._pool.draw(order, self._folder, self._bones) for order in orders]

    def finish(self) -> tuple[dict[str, Any], float]:
        """Return the report entry of the figures and the drawing time [s]."""
        reason, written, seconds = can_render(), list[str](), 0.0
        try:
            for job, order in zip(self._jobs, self._orders, strict=False):
                seconds += job.result()
                written.append(f"{order.name}.png")
        except BrokenProcessPool:
            reason = "the drawing process ended early"
        if self._pool is None and self._orders:
            before = time.perf_counter()
            written = [path.name for path in draw_all(self._orders, self._folder, self._bones)]
            seconds = time.perf_counter() - before
        entry: dict[str, Any] = {"written": sorted(written)}
        if reason is None:
            return entry, seconds
        what = "no figures were drawn" if not written else "not all figures were drawn"
        warnings.warn(f"{what}; all further results were written: {reason}", stacklevel=5)
        return entry | {"reason": reason}, seconds


def draw_all(
    orders: list[FigureOrder], folder: Path, bones: DrawnBones, form: str = "png", **options: float
) -> list[Path]:
    """Draw figures in turn, and return the files."""
    import matplotlib as mpl  # noqa: PLC0415 -- only figures need it

    from vtkmuscle.plotting.sheets import DOTS_PER_INCH, SCREEN, set_style  # noqa: PLC0415
    from vtkmuscle.plotting.studio import Studio  # noqa: PLC0415

    with mpl.rc_context(), Studio(options.get("dpi", SCREEN) / DOTS_PER_INCH) as studio:
        set_style()
        return [order.write(folder, bones, studio, form, **options) for order in orders]


def rest_pose_of(result: "Result") -> FigureOrder:
    """Return the figure of a result's muscles at rest, with fixed points."""
    at_rest = {name: result.track(name).rest for name in result.muscle_names}
    keywords = {"muscles": at_rest, "title": f"{result.name}: fixed points at rest", "units": result.units}
    return FigureOrder("rest_pose", "plot_rest_pose", keywords, rendered=True)


def figures_of_muscle(result: "Result", name: str) -> list[FigureOrder]:
    """Return the figures of a muscle: frames, lengths and moment arms. Empty for a muscle without frames."""
    if not result.finished(name):
        return []
    track, title = result.track(name), label_of(name)
    keywords: dict[str, Any] = {"frames": _frames(result, name), "rest_fibres": track.rest_fibres}
    keywords |= {"title": title, "units": result.units}
    figures = [FigureOrder(f"{name}_frames", "plot_muscle", keywords, rendered=True)]
    curves = {"path": ("lengths", result.lengths), "fibre": ("fibre_lengths", result.fibre_lengths)}
    for of, (suffix, lengths) in curves.items():
        if name in lengths:
            keywords = {"times": result.times[: len(lengths[name])], "lengths": lengths[name], "of": of}
            keywords |= {"title": title, **_time_axis(result, name, len(lengths[name]))}
            figures.append(FigureOrder(f"{name}_{suffix}", "plot_lengths", keywords))
    if arms := result.all_arms.get(name):
        keywords = {"arms": dict(arms), "rest": MuscleFrame(track.rest, {}, track.rest_fibres, title)}
        keywords |= {"literature": result.published_arms(name), "units": result.units}
        figures.append(FigureOrder(f"{name}_moment_arms", "plot_moment_arms", keywords, rendered=True))
    return figures


def _frames(result: "Result", name: str) -> list[MuscleFrame]:
    """Return three finished frames of a muscle. The first, the worst or else the middle, and the last.

    The worst counts in the middle two thirds: next to an end it would show the same twice.
    """
    finished, track = result.frames[: result.finished(name)], result.track(name)
    inner = finished[len(finished) // 6 : len(finished) - len(finished) // 6]
    reasons = result.report["muscles"][name].get("verdict", {}).get("reasons", ())
    worst = [reason["frame"] for reason in reasons[:1] if reason["frame"] in inner]
    frames = []
    for number in sorted({finished[0], *(worst or [finished[(len(finished) - 1) // 2]]), finished[-1]}):
        i = result.frames.index(number)
        fibres: Any = track.fibres[i] if track.fibres else None
        points = points_of(track.surfaces[i]) if track.surfaces else None
        muscle = fibre_surface(fibres) if points is None else with_points(track.rest, points)
        moved = result.motion.at(float(result.motion.times[number]))
        frames.append(MuscleFrame(muscle, moved, fibres, _at(result, name, number)))
    return frames


def _at(result: "Result", name: str, frame: int) -> str:
    """Return a frame's time or coordinates: ``time 3``, ``hip flexion 30°``."""
    parts = []
    for label, values in _axis_values(result, name).items():
        word, _, unit = label.partition(" [")
        parts.append(f"{word} {_rounded(values, frame)} {unit.removesuffix(']')}".strip())
    return ", ".join(parts).replace(" degrees", "°")


def _rounded(values: Floats, frame: int) -> str:
    """Return a value to a hundredth of the values' span."""
    span = float(np.ptp(values)) or 1.0
    return f"{round(float(values[frame]), max(0, 2 - math.ceil(math.log10(span)))) + 0.0:g}"


def _axis_values(result: "Result", name: str) -> dict[str, Floats]:
    """Return the times by label. Up to three coordinates of a muscle, if the time is no coordinate."""
    crossed, every = result.crosses.get(name), result.motion.coordinates
    names = [key for key in every if np.ptp(every[key].values) > 0.0 and (crossed is None or key in crossed)]
    if result.time_label not in UNNAMED or not 1 <= len(names) <= 3:
        return {result.time_label: result.motion.times}
    return {label_of(key, every[key].unit): every[key].values for key in names}


def _time_axis(result: "Result", name: str, count: int) -> dict[str, Any]:
    """Return the label of a time axis, and seven ticks with the values of several coordinates."""
    frames, shown = result.frames[:count], _axis_values(result, name)
    if result.time_label in shown:
        return {"time_label": result.time_label}
    chosen = sorted({frames[round(part)] for part in np.linspace(0, count - 1, 7)})
    ticks = {result.motion.times[k]: "\n".join(_rounded(v, k) for v in shown.values()) for k in chosen}
    return {"time_label": "\n".join(shown), "ticks": ticks}


#: Colours of landmarks by their role.
_ROLES = {"origin": "black", "insertion": "red", "via": "white"}


def plotter_at_rest(scene: SceneData, off_screen: bool | None) -> Any:
    """Return a plotter with a scene at rest. Bones, muscles and landmarks."""
    import pyvista  # noqa: PLC0415 -- a run needs none

    from vtkmuscle.plotting.plotters import MovingScene  # noqa: PLC0415

    surfaces = {name: muscle.surface for name, muscle in scene.muscles.items()}
    plotter = MovingScene(scene.bones, surfaces, {}, off_screen=off_screen, opacity=0.4).plotter
    for area in (area for muscle in scene.muscles.values() for area in muscle.attachments):
        look = {"color": _ROLES[area.role], "reset_camera": False}
        plotter.add_points(area.landmarks, render_points_as_spheres=True, point_size=11, **look)
        if len(area.landmarks) > 1:
            line = pyvista.lines_from_points(area.landmarks, close=area.closed)
            plotter.add_mesh(line, line_width=4, **look)
    return plotter


class ResultDisplay:
    """A result on a plotter: muscles, fibres and bones.

    The plotter is the attribute ``scene``. ``muscles`` are the shown muscles, default all; ``options`` go to
    :class:`~vtkmuscle.plotting.plotters.MovingScene`.
    """

    def __init__(self, result: "Result", muscles: str | Sequence[str] | None = None, **options: Any) -> None:
        from vtkmuscle.plotting.plotters import MovingScene  # noqa: PLC0415 -- only pictures need it

        self._result = result
        self._names = names(result.muscle_names if muscles is None else muscles)
        self._volumes = result.report["deformer"] != "none"
        fibres = {name: lines for name in self._names if (lines := result.rest_fibres(name)) is not None}
        surfaces = {name: result.rest_muscle(name) for name in self._names} if self._volumes else {}
        self.scene = MovingScene(dict(blocks_of(result.rest_bones())), surfaces, fibres, **options)
        self._fibres = list(fibres)
        self.show(0)

    def show(self, position: int) -> None:
        """Show the kept frame at a position."""
        result, frame = self._result, self._result.frames[position]
        there = [name for name in self._names if position < result.finished(name)]
        bones = {bone: table[frame] for bone, table in result.motion.transforms.items()}
        muscles = {n: points_of(result.muscle(n, frame=frame)) for n in there} if self._volumes else {}
        fibres = {n: points_of(result.fibres(n, frame=frame)) for n in there if n in self._fibres}
        self.scene.show(bones, muscles, fibres)

    def pictures(self) -> Iterator[NDArray[np.uint8]]:
        """Give a picture (height, width, 3) of each kept frame."""
        for position in range(len(self._result.frames)):
            self.show(position)
            self.scene.plotter.render()
            yield np.asarray(self.scene.plotter.screenshot(return_img=True))[..., :3]

    def add_slider(self) -> None:
        """Add a slider over the frame times."""
        times = np.asarray(self._result.times)
        look = {"pointa": (0.25, 0.08), "pointb": (0.75, 0.08), "title_height": 0.022, "style": "modern"}
        look |= {"value": float(times[0]), "title": self._result.time_label}
        look |= {"rng": (float(times.min()), float(times.max()))}
        self.scene.plotter.add_slider_widget(lambda at: self.show(int(np.abs(times - at).argmin())), **look)
