"""Arrays of a page, as the page reads them."""

import base64
import gzip

import numpy as np

from vtkmuscle.report.data import TYPES


def unpacked(text):
    """Return the bytes of a pack's text."""
    return gzip.decompress(base64.b64decode(text))


def array_of(data, where):
    """Return an array from the bytes of a pack."""
    return np.frombuffer(data, TYPES[where["type"]], where["count"], where["at"])


def moving_of(data, where):
    """Return the points (f, n, 3) of moving points in a pack."""
    low, high = (array_of(data, where[part]).astype(np.int64) for part in ("low", "high"))
    folded = low + 256 * high
    whole = ((folded >> 1) ^ -(folded & 1)).reshape(where["frames"], where["points"], 3)
    for frame in range(1, len(whole)):
        whole[frame] += whole[0] if frame == 1 else 2 * whole[frame - 1] - whole[frame - 2]
    return whole * where["step"] + np.array(where["origin"])
