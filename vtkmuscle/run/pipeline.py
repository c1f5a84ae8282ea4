"""The filters of a scene's muscle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vtkmuscle.pipelines import MusclePipeline
from vtkmuscle.scene.data import SceneData


def muscle_pipeline(
    scene: SceneData,
    name: str,
    *,
    neighbours: Mapping[str, Any] | None = None,
) -> MusclePipeline:
    """Return the filters that a run of a scene sends a muscle through.

    Parameters
    ----------
    scene, name : SceneData, str
        Which muscle, of which scene.
    neighbours : mapping of str to algorithm, optional
        Deformers of the muscles that this one is kept out of.

    Examples
    --------
    >>> from vtkmuscle import Scene, phantoms
    >>> from vtkmuscle.run import muscle_pipeline
    >>> scene = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8)
    >>> pipeline = muscle_pipeline(scene, "spindle")
    >>> pipeline.fibres.update().output.GetNumberOfCells()
    8
    """
    muscle = scene.muscles[name]
    return MusclePipeline(
        muscle.surface,
        scene.bones_data(),  # one per muscle: threads must not share what VTK writes to
        scene.motion,
        scene.attachments_data(name),
        superficial=muscle.superficial_fibres,
        aponeuroses=scene.aponeuroses_data(name),
        neighbours=neighbours,
        model=scene.model,
        fixing=scene.fixing_of(name),
        fibres=muscle.fibres,
        solver=None if scene.model == "paths" else scene.solver_of(name),
    )
