"""Running a scene: muscles measured over the motion, results written to a folder."""

import lazy_loader

#: Names are in the stub file; the first use of a name loads its module.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
