"""Compatibility of ParaView 5.11 with Python 3.11.

Python runs a file with the name sitecustomize at start-up if the folder is in PYTHONPATH.
"""

import inspect

if not hasattr(inspect, "getargspec"):
    inspect.getargspec = inspect.getfullargspec  # type: ignore[attr-defined]
