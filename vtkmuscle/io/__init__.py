"""Readers and writers: surfaces, landmarks, motion tables and time series.

A reader raises a ``FileNotFoundError`` or a ``ValueError`` with the file and the remedy, and keeps VTK's
messages off the terminal.
"""

import lazy_loader

#: Names are in the stub file; the first use of a name loads its module.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
