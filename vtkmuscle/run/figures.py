"""The figures of a run, a file per figure."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Mapping
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.data.drawn_bones import DrawnBones
from vtkmuscle.plotting.drawing import FigureOrder, MuscleFrame, can_render
from vtkmuscle.plotting.views import fibre_surface

if TYPE_CHECKING:
    from vtkmuscle.run.pool import Pool
    from vtkmuscle.run.result import Result

#: Formats of figures.
FORMS = ("png", "pdf", "svg")


def draw_run(
    result: Result, folder: Path, pool: Pool | None, meanwhile: Callable[[], None]
) -> tuple[dict[str, Any], float]:
    """Draw the figures of a run into a folder.

    Returns the report entry of the figures and the drawing time [s]. The processes of a pool draw while this
    process calls ``meanwhile``. A UserWarning gives the reason of missing figures; an OSError is raised if a
    file cannot be written.
    """
    reason = can_render()
    orders = figures_of(result.plain()) if reason is None else []
    jobs = [] if pool is None else [pool.draw(order, folder) for order in orders]
    meanwhile()
    written, seconds = [], 0.0
    try:
        for job, order in zip(jobs, orders, strict=pool is not None):
            seconds += job.result()
            written.append(f"{order.name}.png")
    except BrokenProcessPool:
        reason = "the process that drew them ended early"
    if pool is None and orders:
        before = time.perf_counter()
        written = [path.name for path in _drawn(orders, folder, result.drawn_bones)]
        seconds = time.perf_counter() - before
    entry: dict[str, Any] = {"written": sorted(written)}
    if reason is None:
        return entry, seconds
    what = "no figures were drawn" if not written else "not all figures were drawn"
    warnings.warn(f"{what}, all else was written: {reason}", stacklevel=5)
    return entry | {"reason": reason}, seconds


def write_figures(folder: str | Path, result: Result, *, form: str = "png", dpi: float = 150.0) -> list[Path]:
    """Write all figures; see :meth:`vtkmuscle.Result.write_figures`."""
    if form not in FORMS:
        raise InputError(form, "a figure is one of png, pdf and svg", "choose one of these")
    if not 20.0 <= dpi <= 2400.0:
        raise InputError("", f"dpi is {dpi:g}, but a figure has 20 to 2400 pixels to an inch", "e.g. 300")
    reason = can_render()
    if reason is not None:
        raise RuntimeError(f"no figures can be made: {reason}")
    return _drawn(figures_of(result), Path(folder), result.drawn_bones, form, dpi)


def _drawn(
    orders: list[FigureOrder], folder: Path, bones: DrawnBones, form: str = "png", dpi: float = 150.0
) -> list[Path]:
    """Draw figures in turn, and return the files."""
    import matplotlib as mpl  # noqa: PLC0415 -- only figures need it

    from vtkmuscle.plotting.sheets import DOTS_PER_INCH  # noqa: PLC0415
    from vtkmuscle.plotting.studio import Studio  # noqa: PLC0415

    with mpl.rc_context(), Studio(dpi / DOTS_PER_INCH) as studio:
        mpl.rcdefaults()  # a matplotlibrc in the working folder may be from elsewhere
        return [order.write(folder, bones, studio, form, dpi) for order in orders]


def figures_of(result: Result) -> list[FigureOrder]:
    """Return all figures of a run."""
    at_rest = {name: result.rest_muscle(name) for name in result.muscle_names}
    figures = [rest_pose(result.name, result.units, at_rest)]
    for name in result.muscle_names:
        figures += figures_of_muscle(result, name)
    return figures + _moment_arms(result)


def rest_pose(scene: str, units: str, muscles: Mapping[str, vtkPolyData]) -> FigureOrder:
    """Return the figure of a scene at rest.

    Muscles with fixed points.
    """
    given = {"muscles": dict(muscles), "title": f"{scene}: fixed points at rest", "units": units}
    return FigureOrder("rest_pose", "plot_rest_pose", given, rendered=True)


def figures_of_muscle(result: Result, name: str) -> list[FigureOrder]:
    """Return the frame and length figures of a muscle.

    Empty for a muscle without frames.
    """
    if not result.finished(name):
        return []
    figures = [FigureOrder(f"{name}_frames", "plot_muscle", _frames(result, name), rendered=True)]
    for of, suffix, known in (
        ("path", "lengths", result.lengths),
        ("fibre", "fibre_lengths", result.fibre_lengths),
    ):
        if name in known:
            times = result.times[: len(known[name])]
            words = {"of": of, "title": _title(name), "time_label": result.time_label}
            given = {"times": times, "lengths": known[name], **words}
            figures.append(FigureOrder(f"{name}_{suffix}", "plot_lengths", given))
    return figures


def _moment_arms(result: Result) -> list[FigureOrder]:
    """Return each muscle's figure of moment arms.

    The moment arms need all muscles.
    """
    figures = []
    for name, arms in (result.moment_arms() if result.has_moment_arms else {}).items():
        if result.finished(name):
            given = {
                "arms": dict(arms),
                "rest": MuscleFrame(result.rest_muscle(name), {}, result.rest_fibres(name), _title(name)),
                "literature": tuple(result.literature.get(name, ())),
                "units": result.units,
            }
            figures.append(FigureOrder(f"{name}_moment_arms", "plot_moment_arms", given, rendered=True))
    return figures


def _frames(result: Result, name: str) -> dict[str, object]:
    volumes = result.report["deformer"] != "none"
    frames = []
    for number in _chosen_frames(result, name):
        fibres = result.fibres(name, frame=number)
        muscle = result.muscle(name, frame=number) if volumes else fibre_surface(fibres)
        moved = result.motion.at(float(result.motion.times[number]))
        frames.append(MuscleFrame(muscle, moved, fibres, _at(result, number)))
    rest = result.rest_fibres(name)
    return {"frames": frames, "rest_fibres": rest, "title": _title(name), "units": result.units}


def _title(name: str) -> str:
    return name.replace("_", " ")


def _chosen_frames(result: Result, name: str) -> list[int]:
    """Return the first, worst and last finished frame.

    Frames of a muscle; the middle frame stands in for a missing worst frame.
    """
    frames = result.frames[: result.finished(name)]
    reasons = result.report["muscles"][name].get("verdict", {}).get("reasons", ())
    worst = [reason["frame"] for reason in reasons[:1] if reason["frame"] in frames]
    return sorted({frames[0], *(worst or [frames[(len(frames) - 1) // 2]]), frames[-1]}) if frames else []


def _at(result: Result, frame: int) -> str:
    """Return the rounded time of a frame as a label.

    Rounded to a hundredth of the span of times: ``time 3``, or ``hip flexion 30 deg``.
    """
    times = result.motion.times
    span = float(np.ptp(times)) or 1.0
    name, _, unit = result.time_label.partition(" [")
    rounded = round(float(times[frame]), max(0, 2 - math.ceil(math.log10(span)))) + 0.0
    return f"{name} {rounded:g} {unit.removesuffix(']')}".strip()
