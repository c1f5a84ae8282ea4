"""A result on a plotter, moved from frame to frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.words import names, suggestion
from vtkmuscle.data.arrays import blocks_of, points_of
from vtkmuscle.plotting import MovingScene, Pose
from vtkmuscle.scene.data import SceneData

if TYPE_CHECKING:
    from vtkmuscle.run.frames import KeptFrames


#: Colours of landmarks by their role.
_ROLES = {"origin": "black", "insertion": "red", "via": "white"}


def plotter_at_rest(scene: SceneData, off_screen: bool | None) -> Any:
    """Return a plotter with the bones, muscles and landmarks of a scene."""
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
    """The muscles, fibres and bones of a result on a plotter.

    Parameters
    ----------
    result : KeptFrames
        A :class:`vtkmuscle.Result`.
    muscles : str or sequence of str, optional
        Which to show; default all.
    **options
        Of :class:`~vtkmuscle.plotting.MovingScene`.

    Attributes
    ----------
    scene : MovingScene
        What is drawn.
    times : list of float
        Of the kept frames.
    time_label : str
        What these are.
    """

    def __init__(
        self, result: KeptFrames, muscles: str | Sequence[str] | None = None, **options: Any
    ) -> None:
        self._result = result
        self.times, self.time_label = list(result.times), result.time_label
        self._names = names(result.muscle_names if muscles is None else muscles)
        for name in self._names:
            if name not in result.muscle_names:
                known = suggestion(name, result.muscle_names)
                raise InputError("", f"there is no muscle {name!r} in the result", known)
        self._volumes = result.report["model"] != "paths"
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
        """Show a kept frame, by its place among them."""
        result, frame = self._result, self._result.frames[position]
        there = [name for name in self._names if position < result.finished(name)]
        moving = result.motion.transforms
        self.scene.show(
            Pose(
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
        """Add a slider over the times of the frames to the plotter."""
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
