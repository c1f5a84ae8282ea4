"""Readers and writers of the field's formats: surfaces, landmarks, motion tables, time series.

Every reader raises a ``FileNotFoundError`` or a ``ValueError`` that names the file and the remedy, and
keeps VTK's own messages off the terminal.
"""

import lazy_loader

#: As the stub beside this file has them; a module is loaded when one of its names is asked for.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
