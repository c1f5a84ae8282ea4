"""Pictures and figures of a run.

Surfaces are rendered in parallel projection on white, by VTK for figures and by PyVista for windows. Panels,
titles, legends and curves are objects of matplotlib, without changes to the global state of a library.
Windows open on request only.
"""

import lazy_loader

#: Names are in the stub file; the first use of a name loads its module.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
