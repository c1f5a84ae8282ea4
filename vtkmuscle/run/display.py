"""Results on a plotter, frame by frame, and films.

Films are a .gif by Pillow or an .mp4 by FFmpeg.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.words import names, suggestion
from vtkmuscle.data.arrays import blocks_of, points_of
from vtkmuscle.io.writing import replacing
from vtkmuscle.plotting import MovingScene, ScenePose, can_render
from vtkmuscle.scene.data import SceneData

if TYPE_CHECKING:
    from vtkmuscle.run.result_data import ResultData


def film_of(
    result: ResultData, path: Path, *, fps: float, muscles: str | Sequence[str] | None, size: tuple[int, int]
) -> Path:
    """Write a film of all kept frames.

    All or nothing; see :meth:`vtkmuscle.Result.movie`.
    """
    write = {".gif": _write_gif, ".mp4": _write_mp4}.get(path.suffix.lower())
    if write is None:
        raise InputError(str(path), "a film is one of .gif, .mp4", "give it one of these suffixes")
    if not fps > 0:
        raise InputError("", f"fps is {fps}, but must be a number > 0")
    if write is _write_mp4:
        _ffmpeg()
    if any(side < 2 or side % 2 for side in size):
        raise InputError("", f"size is {size}, but must be two even numbers of pixels, e.g. (1024, 768)")
    reason = can_render()
    if reason is not None:
        raise RuntimeError(f"no film can be made: {reason}")
    shown = ResultDisplay(result, muscles, off_screen=True, size=size)
    with closing(shown.scene.plotter), replacing(path) as beside:
        write(beside, shown.pictures(), fps)
    return path


def _write_gif(path: Path, pictures: Iterator[NDArray[np.uint8]], fps: float) -> None:
    from PIL import Image  # noqa: PLC0415 -- matplotlib has it; only films need it

    # One palette for all: colours that change from picture to picture flicker.
    first, *others = (Image.fromarray(picture).quantize(128) for picture in pictures)
    first.save(path, format="GIF", save_all=True, append_images=others, duration=round(1000 / fps), loop=0)


def _write_mp4(path: Path, pictures: Iterator[NDArray[np.uint8]], fps: float) -> None:
    first = next(pictures)
    height, width = first.shape[:2]
    named = path.with_name(path.name + ".mp4")  # FFmpeg goes by the name
    writer = _ffmpeg().write_frames(str(named), (width, height), fps=fps, macro_block_size=2, quality=8)
    try:
        writer.send(None)
        for picture in chain([first], pictures):
            writer.send(np.ascontiguousarray(picture))
        writer.close()
        named.replace(path)
    finally:
        named.unlink(missing_ok=True)


def _ffmpeg() -> Any:
    try:
        import imageio_ffmpeg  # noqa: PLC0415 -- an extra
    except ImportError as error:
        raise ImportError(
            "an .mp4 needs imageio-ffmpeg: python -m pip install '.[movie]'; a .gif needs no more"
        ) from error
    return imageio_ffmpeg


#: Colours of landmarks by their role.
_ROLES = {"origin": "black", "insertion": "red", "via": "white"}


def plotter_at_rest(scene: SceneData, off_screen: bool | None) -> Any:
    """Return a plotter with a scene at rest.

    Bones, muscles and landmarks.
    """
    import pyvista  # noqa: PLC0415 -- a run needs none

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
    :class:`~vtkmuscle.plotting.MovingScene`.
    """

    def __init__(
        self, result: ResultData, muscles: str | Sequence[str] | None = None, **options: Any
    ) -> None:
        self._result = result
        self.times, self.time_label = list(result.times), result.time_label
        self._names = names(result.muscle_names if muscles is None else muscles)
        for name in self._names:
            if name not in result.muscle_names:
                known = suggestion(name, result.muscle_names)
                raise InputError("", f"there is no muscle {name!r} in the result", known)
        self._volumes = result.report["deformer"] != "none"
        fibres = {name: lines for name in self._names if (lines := result.rest_fibres(name)) is not None}
        self.scene = MovingScene(
            dict(blocks_of(result.rest_bones())),
            {name: result.rest_muscle(name) for name in self._names} if self._volumes else {},
            fibres,
            **options,
        )
        self._fibres = list(fibres)
        self.show(0)

    def show(self, position: int) -> None:
        """Show the kept frame at a position."""
        result, frame = self._result, self._result.frames[position]
        there = [name for name in self._names if position < result.finished(name)]
        moving = result.motion.transforms
        self.scene.show(
            ScenePose(
                {bone: table[frame] for bone, table in moving.items()},
                {n: points_of(result.muscle(n, frame=frame)) for n in there} if self._volumes else {},
                {n: points_of(result.fibres(n, frame=frame)) for n in there if n in self._fibres},
            )
        )

    def pictures(self) -> Iterator[NDArray[np.uint8]]:
        """Give a picture (height, width, 3) of each kept frame."""
        for position in range(len(self._result.frames)):
            self.show(position)
            self.scene.plotter.render()
            yield np.asarray(self.scene.plotter.screenshot(return_img=True))[..., :3]

    def add_slider(self) -> None:
        """Add a slider over the frame times."""
        times = np.asarray(self.times)

        def moved(time: float) -> None:
            self.show(int(np.abs(times - time).argmin()))

        self.scene.plotter.add_slider_widget(
            moved,
            (float(times.min()), float(times.max())),
            value=float(times[0]),
            title=self.time_label,
            pointa=(0.25, 0.08),
            pointb=(0.75, 0.08),
            title_height=0.022,
            style="modern",
        )
