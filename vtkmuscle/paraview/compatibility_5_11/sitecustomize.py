"""For ParaView 5.11 with Python 3.11: its plugin loader imports a function that Python 3.11 no longer has.

Python runs a file of this name at start-up where its folder is in PYTHONPATH.
"""

import inspect

if not hasattr(inspect, "getargspec"):
    inspect.getargspec = inspect.getfullargspec  # type: ignore[attr-defined]
