"""OpenSim and MuJoCo: models read and written, muscles of scenes for other programs.

Only scenes with joints or a model, and the commands, use the package. Models are written from a
:class:`~vtkmuscle.opensim.tree.KinematicTree` with paths; tests compare lengths and moment arms with
OpenSim's.
"""

import lazy_loader

#: As the stub beside this file has them; a module is loaded when one of its names is asked for.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
