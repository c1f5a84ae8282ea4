"""Arrays for a page: quantised, told apart in time, compressed and written as text."""

from __future__ import annotations

import base64
import gzip
from typing import Any

import numpy as np

from vtkmuscle.core.types import Floats

#: Steps that the longest side of moving points is cut into: 0.03 mm of half a metre.
STEPS = 20_000

#: How arrays are called in a page, and what they are.
TYPES = {"u8": np.uint8, "i8": np.int8, "u16": np.uint16, "u32": np.uint32, "f32": np.float32}


class Pack:
    """Arrays one behind the other, each known by a small dict that a page finds it by.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.report.packing import Pack
    >>> pack = Pack()
    >>> pack.add(np.arange(3), "u16")
    {'at': 0, 'count': 3, 'type': 'u16'}
    >>> pack.add(np.ones(2), "f32")
    {'at': 8, 'count': 2, 'type': 'f32'}
    >>> len(pack.text()) > 0
    True
    """

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0

    def add(self, values: Any, kind: str) -> dict[str, Any]:
        """Take an array in, as one of :data:`TYPES`, and return where it is."""
        array = np.ascontiguousarray(np.asarray(values), dtype=TYPES[kind])
        return {**self._append(array.tobytes()), "count": int(array.size), "type": kind}

    def add_moving(self, frames: Floats) -> dict[str, Any]:
        """Take points that move, (f, n, 3), in; they come out within half a step.

        They are whole numbers of steps from ``origin``. Of each frame what is kept is by how much it differs
        from where the two before it lead to, the low bytes of all apart from the high ones: few of these are
        not zero.
        """
        low = frames.min(axis=(0, 1)) if frames.size else np.zeros(3)
        extent = float((frames.max(axis=(0, 1)) - low).max()) if frames.size else 0.0
        step = max(extent, 1e-9) / STEPS
        whole = np.rint((frames - low) / step).astype(np.int32)
        differences = whole.copy()
        differences[1:] -= whole[:-1]
        differences[2:] -= whole[1:-1] - whole[:-2]
        folded = ((differences << 1) ^ (differences >> 31)).astype(np.uint32)
        low_bytes, high_bytes = (folded & 255).astype(np.uint8), (folded >> 8).astype(np.uint16)
        return {
            "frames": len(frames),
            "points": int(frames.shape[1]),
            "origin": [float(value) for value in low],
            "step": step,
            "low": self.add(low_bytes, "u8"),
            "high": self.add(high_bytes, "u16"),
        }

    def text(self) -> str:
        """Return all arrays, compressed by gzip, in base64."""
        return packed(b"".join(self._parts))

    def _append(self, data: bytes) -> dict[str, int]:
        at = self._size
        padding = -len(data) % 4
        self._parts += [data, b"\0" * padding]
        self._size += len(data) + padding
        return {"at": at}


def packed(data: bytes) -> str:
    """Return bytes compressed by gzip, in base64; higher levels save 1 to 4 % and take twice the time."""
    return base64.b64encode(gzip.compress(data, 4, mtime=0)).decode("ascii")
