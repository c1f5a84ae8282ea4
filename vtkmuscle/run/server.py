"""First call of a kernel in the server of child processes.

Numba takes a quarter of a second for the first call in a process; processes forked afterwards take nothing.
"""

import numpy as np

from vtkmuscle.core.motion.rigid import apply_transform

apply_transform(np.eye(4), np.zeros((1, 3)))
