"""A scene: bones, muscles, attachments and a motion, read from a scene.toml and written to one.

``schema`` has the keys of the file, ``validation`` checks them, ``reading`` and ``writing`` handle the files,
``checks`` tests the surfaces and landmarks, and ``sense`` reports what is implausible.
:class:`vtkmuscle.Scene` combines them.
"""

from vtkmuscle.scene.data import Muscle, SceneData
from vtkmuscle.scene.faults import SceneError

__all__ = ["Muscle", "SceneData", "SceneError"]
