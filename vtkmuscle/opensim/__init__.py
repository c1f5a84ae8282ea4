"""Models of OpenSim and MuJoCo, read, checked and written.

Models are written from a :class:`~vtkmuscle.joints.tree.KinematicTree` with paths, so that tests can compare
lengths and moment arms with OpenSim's.
"""

import lazy_loader

#: Names are in the stub file; the first use of a name loads its module.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
