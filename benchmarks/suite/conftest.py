"""How benchmarks are measured: in turns with the calibration kernel, whose time theirs is divided by.

Run as ``pytest benchmarks/suite [--benchmark-json FILE]`` with pytest-benchmark (in the ``dev`` extra);
``extra_info`` has the times in calibrations.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from calibration import calibration
from problems import Hip


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add what limits the benchmarks."""
    parser.addoption("--largest", type=int, default=100_000, help="most triangles of the scaling")


@pytest.fixture(scope="session")
def hip() -> Hip:
    """Return the phantom hip."""
    return Hip()


@pytest.fixture(scope="session")
def calibrate() -> Callable[[], object]:
    """Return the kernel, compiled."""
    run = calibration()
    run()
    return run


@pytest.fixture
def measured(benchmark: Any, calibrate: Callable[[], object]) -> Callable[..., None]:
    """Measure a function; ``extra_info`` tells in how many calibrations, and at which size of what."""

    def measure(run: Callable[[], object], *, rounds: int, **about: Any) -> None:
        taken: list[float] = []

        def before_each() -> None:
            begin = time.perf_counter()
            calibrate()
            taken.append(time.perf_counter() - begin)

        benchmark.pedantic(run, setup=before_each, rounds=rounds, warmup_rounds=1)
        benchmark.extra_info.update(about)
        if benchmark.stats is not None:
            benchmark.extra_info["calibrations"] = benchmark.stats.stats.min / min(taken)

    return measure
