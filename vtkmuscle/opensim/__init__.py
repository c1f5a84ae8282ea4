"""Joints and OpenSim: models read and written, scenes with joints, muscles for other programs.

The rest of the package does not need it: only scenes with joints or a model use it, and the command. Models
are written from a :class:`~vtkmuscle.opensim.tree.KinematicTree` with paths, so that a test can compare their
lengths and moment arms with those of the other program.
"""

import lazy_loader

#: As the stub beside this file has them; a module is loaded when one of its names is asked for.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
