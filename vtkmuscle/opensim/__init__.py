"""Joints and OpenSim: models read and written, scenes with joints, muscles for other programs.

The rest of the package does not need it: a scene that has joints or names a model asks for it, and so does
the command. What is written is a :class:`~vtkmuscle.opensim.tree.KinematicTree` with paths, so that a test
can ask the other program for the same lengths and moment arms.
"""

import lazy_loader

#: As the stub beside this file has them; a module is loaded when one of its names is asked for.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
