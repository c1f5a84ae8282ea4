"""Where the real hip is that benchmarks run on."""

from __future__ import annotations

import os
from pathlib import Path


def data_folder() -> Path:
    """Return the folder of the real hip: VTKMUSCLE_DATA, else beside the repository."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    return Path(os.environ.get("VTKMUSCLE_DATA", beside)) / "lhdl_hip"
