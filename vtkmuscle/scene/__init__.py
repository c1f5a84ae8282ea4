"""Scenes: bones, muscles, attachments and a motion, in a scene.toml.

``schema`` has the keys of the file, ``validation`` checks the keys, ``reading`` and ``writing`` handle files,
``checks`` tests surfaces and landmarks, and ``sense`` reports implausible scenes. :class:`vtkmuscle.Scene`
combines all parts.
"""

from vtkmuscle.scene.data import Muscle, SceneData, SceneError

__all__ = ["Muscle", "SceneData", "SceneError"]
