"""Models of OpenSim and MuJoCo, read, checked and written.

Models are written from a :class:`~vtkmuscle.joints.tree.KinematicTree` with paths, so that tests can compare
lengths and moment arms with OpenSim's.
"""

import lazy_loader

#: As the stub beside this file has them; a module is loaded when one of its names is asked for.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
