"""Pipelines in several Python threads of one process, seen in a child process: a crash is a result too."""

import re
from pathlib import Path

import pytest
from commands import python

import vtkmuscle

SCRIPT = """
import hashlib, threading
from vtkmuscle import Scene
from vtkmuscle.data.arrays import points_of
from vtkmuscle.phantoms import spindle_over_hinge, wrapping_cylinder
from vtkmuscle.run import muscle_pipeline

def run(make):
    scene, digest = Scene.from_phantom(make(), n_fibres=8), hashlib.sha256()
    pipeline = muscle_pipeline(scene, *scene.muscles)
    for time in scene.motion.times[1:3]:
        for last in (pipeline.metrics, pipeline.deformer):
            digest.update(points_of(last.update(time=float(time)).output).tobytes())
    return digest.hexdigest()

JOBS = spindle_over_hinge, wrapping_cylinder
expected = [run(make) for make in JOBS]
assert len(set(expected)) == len(JOBS)
for jobs in ((0, 1), (0, 0)):
    found, together = {}, threading.Barrier(2)

    def work(place, job):
        together.wait()
        found[place] = run(JOBS[job])

    threads = [threading.Thread(target=work, args=pair) for pair in enumerate(jobs)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == {place: expected[job] for place, job in enumerate(jobs)}, jobs
print("same")
"""


@pytest.mark.slow
def test_two_pipelines_in_two_threads_give_what_they_give_one_after_the_other():
    assert python("-c", SCRIPT).stdout.strip() == "same"


def test_no_kernel_uses_a_threading_layer_of_numba():
    """Its workqueue layer, the only one that is always there, aborts the process on concurrent calls."""
    package = Path(vtkmuscle.__file__).parent
    sources = {path: path.read_text(encoding="utf-8") for path in package.rglob("*.py")}
    assert len(sources) > 50
    uses = re.compile(r"parallel\s*=\s*True|\bprange\b|\bguvectorize\b|set_num_threads")
    assert not [str(path) for path, text in sources.items() if uses.search(text)]
