"""Long runs, killed on the way: the same result, and memory that grows by what is kept and by no more."""

import gc
import sys
from pathlib import Path

import pytest
from tiny_scene import HINGE, MOTION, write_tiny_scene

from vtkmuscle import Scene

sys.path.insert(0, str(Path(__file__).parent / "filters"))
from test_memory import in_use

pytestmark = pytest.mark.long

FRAMES = 1000
#: Growth that is noise: caches of Python and VTK, fragments, and what further threads hold [bytes].
NOISE = 20e6


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory):
    """A scene of two muscles over 1 000 frames."""
    path = write_tiny_scene(tmp_path_factory.mktemp("long") / "scene")
    text = path.read_text().replace(
        MOTION, HINGE.replace("[0, 20, 5]", f"[0, 20, {20 / (FRAMES - 1)}]") + "\n"
    )
    start, end = text.index("[muscles.spindle]"), text.index("[solver]")
    path.write_text(text[:end] + text[start:end].replace("spindle]", "other]") + text[end:])
    return path


@pytest.fixture(scope="module")
def whole(scene_file, tmp_path_factory):
    """The folder of a run that nobody stops, and the memory in use: before, on the way, and after it."""
    out, used = tmp_path_factory.mktemp("whole") / "out", {}

    def progress(muscle, stage, part):
        if part > 0.0 and round(part * FRAMES) % 200 == 0:
            used[muscle, round(part * FRAMES)] = in_use()

    scene = Scene.load(scene_file)
    scene.run(None, frames="0:2", figures=False)  # what is compiled and loaded
    used["before"] = in_use()
    result = scene.run(out, figures=False, workers=1, progress=progress)
    frame = 48 * result.rest_muscle("spindle").n_points
    frame += 1024 * result.fibres("spindle", frame=0).GetActualMemorySize()
    used["kept"] = FRAMES * frame
    del result
    gc.collect()
    used["after"] = in_use()
    return out, used


def test_memory_grows_by_the_frames_that_are_kept_and_all_is_given_back(whole):
    _, used = whole
    for name in ("spindle", "other"):
        first, second = (used[name, end] - used[name, end - 400] for end in (600, 1000))
        assert second < 1.1 * first + NOISE, (name, first, second)
        # VTK does not count what an array needs beside its numbers.
        assert used[name, 1000] - used[name, 200] < 4.0 * used["kept"], (name, used)
    assert used["after"] - used["before"] < NOISE, used
