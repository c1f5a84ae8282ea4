"""The benchmarks as modules."""

import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module", autouse=True)
def benchmarks():
    """Let benchmarks and the experiments of the papers be imported; return their folder."""
    if not FOLDER.is_dir():
        pytest.skip("the benchmarks are not here")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", [str(FOLDER), str(FOLDER / "paper"), *sys.path])
        yield FOLDER
