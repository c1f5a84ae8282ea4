"""Readers and writers: surfaces, landmarks, motion tables and time series.

A reader raises a ``FileNotFoundError`` or a ``ValueError`` with the file and the remedy, and keeps VTK's
messages off the terminal.
"""

import lazy_loader

#: As the stub beside this file has them; a module is loaded when one of its names is asked for.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
