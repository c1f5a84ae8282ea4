"""MuscleScene: a scene.toml as a source of data, for ParaView's File, Open."""

from __future__ import annotations

from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.words import suggestion
from vtkmuscle.data.arrays import multiblock_from
from vtkmuscle.data.attachments import attachments_from
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.base.ports import OutputPort
from vtkmuscle.scenes import Scene


class MuscleScene(Filter):
    """Give a muscle of a scene.toml, with the scene's bones and the muscle's attachments.

    The motion of the bones is read by BoneMotion, from the same file. Settings of the scene's solver are not
    passed on: they are properties of the filters here.

    Raises
    ------
    ValueError
        If there is no scene or no such muscle.

    Examples
    --------
    >>> from vtkmuscle import Scene, phantoms
    >>> from vtkmuscle.paraview.muscle_scene import MuscleScene
    >>> source = MuscleScene(scene=Scene.from_phantom(phantoms.spindle_over_hinge()), muscle="spindle")
    >>> muscle, bones, attachments = source.update().output
    >>> bones.GetNumberOfBlocks(), attachments.GetNumberOfBlocks()
    (2, 2)
    """

    scene: Parameter[Scene | None] = Parameter(Scene, default=None, doc="The scene.")
    muscle = Parameter(str, default="", doc="Name of the muscle; empty for the scene's first.")

    surface = OutputPort(vtkPolyData, doc="The muscle, in the rest pose.")
    bones = OutputPort(vtkMultiBlockDataSet, doc="The bones by name, in the rest pose.")
    attachments = OutputPort(vtkMultiBlockDataSet, doc="The muscle's attachment areas, a block for each.")

    def execute(self) -> tuple[vtkPolyData, vtkMultiBlockDataSet, vtkMultiBlockDataSet]:
        """Return surface, bones and attachments."""
        if self.scene is None:
            raise ValueError("MuscleScene.scene is None; name a scene.toml")
        muscles = self.scene.muscles
        name = self.muscle or next(iter(muscles))
        if name not in muscles:
            raise ValueError(
                f"MuscleScene.muscle: there is no muscle {name!r} in the scene; {suggestion(name, muscles)}"
            )
        return (
            muscles[name].surface,
            multiblock_from(dict(self.scene.bones)),
            attachments_from(muscles[name].attachments),
        )
