"""A scene on a plotter, its muscles solved for the times that are asked for."""

from __future__ import annotations

from typing import Any

from vtkmuscle.data.arrays import points_of
from vtkmuscle.plotting import MovingScene, Pose
from vtkmuscle.run.frames import time_label
from vtkmuscle.run.muscles import muscle_pipeline
from vtkmuscle.scenes import Scene


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
