"""The viewer's page and its server, by trame."""

from __future__ import annotations

import asyncio
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.data.arrays import points_of
from vtkmuscle.plotting import MovingScene, Pose, View, can_render
from vtkmuscle.run.display import ResultDisplay
from vtkmuscle.run.result_data import time_label
from vtkmuscle.run.muscles import muscle_pipeline
from vtkmuscle.run.result import Result
from vtkmuscle.scenes import Scene
from vtkmuscle.view.guard import HOST, guarded

#: Directions to look from, beside the one that shows most of the muscles.
DIRECTIONS = {
    "+x": (1.0, 0.0, 0.0),
    "-x": (-1.0, 0.0, 0.0),
    "+y": (0.0, 1.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "above": (0.001, 0.0, 1.0),
}
#: Quality at which a scene is solved while one looks at it.
QUALITY = "preview"
#: Frames per second of the player [1/s].
_RATE = 12.0


class Display(Protocol):
    """Frames on a plotter: of a result, or of a scene that is solved."""

    scene: MovingScene
    times: list[float]
    time_label: str

    def show(self, position: int) -> None:
        """Show a frame by its place."""


def view(
    source: Result | Scene | str | PathLike[str],
    *,
    port: int = 0,
    browser: bool = True,
) -> None:
    """Open the viewer in a browser, until it is stopped (Ctrl-C).

    Its server answers on this machine alone, and to whom has the address, which holds a random token.

    Parameters
    ----------
    source : Result, Scene or path
        A result or the folder of one; or a scene or its file, which is solved as the slider moves, with the
        preset ``"preview"``.
    port : int, optional
        Of the server; 0 for a free one.
    browser : bool, optional
        Open the page; else its address is printed.

    Raises
    ------
    InputError
        Without the extra ``view``, if there is no such result or scene, or no picture can be rendered here.
    """
    server = make_app(source)
    with guarded(server, browser=browser):
        server.start(port=port, host=HOST, open_browser=False, show_connection_info=False)


def make_app(source: Result | Scene | str | PathLike[str]) -> Any:
    """Return the viewer's server, not started yet; in a notebook ``make_app(result).ui.ipython()`` shows it.

    Parameters and errors are those of :func:`view`.
    """
    trame = _trame()
    display = _display_of(source)
    server = trame["get_server"](f"vtkmuscle-{id(display)}", client_type="vue3")
    _behaviour(server, display)
    _page(server, display, trame)
    return server


def _trame() -> dict[str, Any]:
    try:
        from trame.app import get_server  # noqa: PLC0415 -- an extra
        from trame.ui.vuetify3 import SinglePageLayout  # noqa: PLC0415
        from trame.widgets import client, vuetify3  # noqa: PLC0415
        from trame_pyvista.ui import get_viewer  # noqa: PLC0415
    except ImportError as error:
        raise InputError(
            "",
            f"the viewer needs trame ({error.name} is missing): python -m pip install '.[view]'",
            "the page report.html of a run needs nothing more",
        ) from error
    return {
        "get_server": get_server,
        "layout": SinglePageLayout,
        "widgets": vuetify3,
        "style": client.Style,
        "get_viewer": get_viewer,
    }


def _display_of(source: Result | Scene | str | PathLike[str]) -> Display:
    reason = can_render()
    if reason is not None:
        raise InputError("", f"nothing can be shown: {reason}", "look at report.html of a run")
    if not isinstance(source, Result | Scene):
        path = Path(source)
        if not path.exists():
            raise InputError(path, "there is no such file or folder", "give a scene.toml or a run's folder")
        source = Result.load(path) if path.is_dir() else Scene.load(path)
    if isinstance(source, Result):
        return ResultDisplay(source, off_screen=True)
    return SceneDisplay(source.with_quality(QUALITY), off_screen=True)


def _behaviour(server: Any, display: Display) -> None:
    """Let the page's state move the scene: the slider, the player and the directions to look from."""
    state, controller = server.state, server.controller
    state.position, state.playing, state.caption = 0, False, _time_text(display, 0)

    def moved(position: int, **_: Any) -> None:
        display.show(int(position))
        state.caption = _time_text(display, int(position))
        controller.view_update()

    def look(name: str) -> None:
        best = display.scene.view
        direction = np.array(DIRECTIONS[name]) if name in DIRECTIONS else best.direction
        display.scene.look(View(direction, best.focus, best.half_height, best.aspect))
        controller.view_update()

    async def play() -> None:
        state.playing = not state.playing
        state.flush()
        while state.playing:
            state.position = (int(state.position) + 1) % len(display.times)
            state.flush()
            await asyncio.sleep(1.0 / _RATE)

    state.change("position")(moved)
    controller.look, controller.play = look, play


def _page(server: Any, display: Display, trame: dict[str, Any]) -> None:
    """Lay out the page: the scene, the slider below it, and what to look from above it."""
    widgets, controller = trame["widgets"], server.controller
    with trame["layout"](server) as layout:
        layout.title.set_text("vtkmuscle")
        layout.icon.hide()
        layout.footer.hide()
        trame["style"]("html { overflow-y: auto !important; }")
        with layout.toolbar:
            widgets.VSpacer()
            for name in ("best", *DIRECTIONS):
                widgets.VBtn(
                    name,
                    click=(controller.look, f"['{name}']"),
                    size="small",
                    classes="text-none",
                    aria_label=f"look from: {name}",
                    __properties=[("aria_label", "aria-label")],
                )
        with layout.content, widgets.VContainer(fluid=True, classes="pa-0 fill-height d-flex flex-column"):
            with widgets.VRow(no_gutters=True, classes="w-100 flex-grow-1"):
                viewer = trame["get_viewer"](display.scene.plotter, server=server, suppress_rendering=True)
                drawn = viewer.ui(mode="server", add_menu=False)
                controller.view_update = drawn.update
            with widgets.VRow(no_gutters=True, classes="w-100 flex-grow-0 align-center px-4 py-2"):
                widgets.VBtn(
                    "{{ playing ? 'Pause' : 'Play' }}", click=controller.play, classes="mr-4 text-none"
                )
                widgets.VSlider(
                    v_model=("position", 0),
                    min=0,
                    max=max(len(display.times) - 1, 1),
                    step=1,
                    hide_details=True,
                    aria_label=display.time_label,
                    __properties=[("aria_label", "aria-label")],
                )
                widgets.VLabel("{{ caption }}", classes="ml-4", style="min-width: 14rem")


def _time_text(display: Display, position: int) -> str:
    name, _, unit = display.time_label.partition(" [")
    return f"{name} {display.times[position]:.4g} {unit.removesuffix(']')}".strip()


class SceneDisplay:
    """The muscles, fibres and bones of a scene on a plotter; a pose is solved when it is first shown.

    The frames before it are computed too, where the solver's answer depends on them; what is known is kept.

    Parameters
    ----------
    scene : Scene
        With the quality that it is to be solved at.
    **options
        Of :class:`~vtkmuscle.plotting.MovingScene`.

    Attributes
    ----------
    scene : MovingScene
        What is drawn.
    times : list of float
        Of the motion.
    time_label : str
        What these are.
    """

    def __init__(self, scene: Scene, **options: Any) -> None:
        self._motion = scene.motion
        self._pipelines = {name: muscle_pipeline(scene, name) for name in scene.muscles}
        self._known: dict[int, Pose] = {}
        self.times = [float(time) for time in scene.motion.times]
        self.time_label = time_label(scene.motion)
        surfaces = {name: muscle.surface for name, muscle in scene.muscles.items()}
        fibres = {
            name: one.fibres.update().output
            for name, one in self._pipelines.items()
            if one.fibres is not None
        }
        self.scene = MovingScene(scene.bones, {} if scene.model == "paths" else surfaces, fibres, **options)
        self.show(0)

    def show(self, position: int) -> None:
        """Show a frame of the motion, by its number."""
        if position not in self._known:
            self._known[position] = self._solved(position)
        self.scene.show(self._known[position])

    def _solved(self, position: int) -> Pose:
        time = self.times[position]
        muscles, fibres = {}, {}
        for name, pipeline in self._pipelines.items():
            if pipeline.deformer is not None:
                muscles[name] = points_of(pipeline.deformer.update(time=time).output)
            carried = pipeline.taut if pipeline.transport is None else pipeline.transport
            if carried is not None and pipeline.fibres is not None:
                fibres[name] = points_of(carried.update(time=time).output)
        bones = {bone: table[position] for bone, table in self._motion.transforms.items()}
        return Pose(bones, muscles, fibres)
