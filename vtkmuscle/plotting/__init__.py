"""Off-screen pictures of a run: muscles, fibres and bones, fibre lengths and moment arms over time.

Surfaces are rendered in parallel projection on white, by VTK into figures and by PyVista where they are to be
moved; panels, titles, legends and curves are set with matplotlib's objects, so that no library's global state
is touched. Nothing here opens
a window unless asked to.
"""

import lazy_loader

#: As the stub beside this file has them; a module is loaded when one of its names is asked for.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
