"""The surfaces of a scene as arrays: opened once, and carried as such through a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, Self

from vtkmuscle.core.bones.bone import Bone, bone_of
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import checked_surface
from vtkmuscle.scene.data import SceneData


class Surface(NamedTuple):
    """A surface: points (n, 3), and triangles (m, 3) of point ids."""

    points: Floats
    triangles: Ints


@dataclass(frozen=True, eq=False)
class Anatomy:
    """The bones and muscles of a scene at rest, by their names.

    Attributes
    ----------
    bones : mapping of str to Bone
        All bones.
    muscles : mapping of str to Surface
        All muscles.
    """

    bones: Mapping[str, Bone]
    muscles: Mapping[str, Surface]

    @classmethod
    def of(cls, scene: SceneData) -> Self:
        """Open the surfaces of a scene.

        Raises
        ------
        ValueError
            If one is no surface of triangles, or a coordinate is not finite.
        """
        bones = {name: bone_of(*checked_surface(bone, name)) for name, bone in scene.bones.items()}
        muscles = scene.muscles.items()
        return cls(bones, {name: Surface(*checked_surface(one.surface, name)) for name, one in muscles})

    @property
    def surfaces(self) -> dict[str, Bone | Surface]:
        """All surfaces, by their keys in a scene."""
        found: dict[str, Bone | Surface] = {f"bones.{name}.surface": one for name, one in self.bones.items()}
        return found | {f"muscles.{name}.surface": one for name, one in self.muscles.items()}

    @property
    def solid_bones(self) -> dict[str, Bone]:
        """The bones that have an inside, holes closed."""
        return {name: bone for name, bone in self.bones.items() if bone.solids.trees}
