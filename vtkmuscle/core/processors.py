"""How many processors this process may use."""

import os


def processors() -> int:
    """Return the number of processors: a job of a cluster, or a container, may have some of them only."""
    if hasattr(os, "sched_getaffinity"):  # not known to macOS and Windows
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
