"""What a scene is: bones, muscles, attachments and a motion, from and to a scene.toml.

``schema`` has the keys of the file, ``validation`` what is said of them, ``reading`` and ``writing`` the
files, ``checks`` what must hold of the surfaces and landmarks, and ``sense`` what is implausible.
:class:`vtkmuscle.Scene` puts all of it together.
"""

from vtkmuscle.scene.data import Muscle, SceneData
from vtkmuscle.scene.faults import SceneError

__all__ = ["Muscle", "SceneData", "SceneError"]
