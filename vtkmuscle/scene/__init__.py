"""What a scene is: bones, muscles, attachments and a motion, from and to a scene.toml."""

from vtkmuscle.scene.model import Muscle, Scene, SceneError

__all__ = ["Muscle", "Scene", "SceneError"]
