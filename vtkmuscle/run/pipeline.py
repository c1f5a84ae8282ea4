"""The filters of a scene's muscle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.data.arrays import multiblock_from
from vtkmuscle.pipelines import MusclePipeline
from vtkmuscle.run.reach import bones_with_reach
from vtkmuscle.scene.data import SceneData


def muscle_pipeline(
    scene: SceneData,
    name: str,
    bones: Mapping[str, vtkPolyData] | None = None,
    *,
    neighbours: Mapping[str, Any] | None = None,
) -> MusclePipeline:
    """Return the filters that a run of a scene sends a muscle through.

    Parameters
    ----------
    scene, name : SceneData, str
        Which muscle, of which scene.
    bones : mapping of str to vtkPolyData, optional
        The scene's bones as :func:`~vtkmuscle.run.reach.bones_with_reach` gives them, where they are there
        already.
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
        # One data set per muscle: threads must not share what VTK writes to.
        multiblock_from(dict(bones_with_reach(scene) if bones is None else bones)),
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
