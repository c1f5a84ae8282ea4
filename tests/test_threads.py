"""Pipelines in several Python threads of one process, seen in a child process: a crash is a result too."""

import re
from pathlib import Path

import pytest
from commands import python

import vtkmuscle

SCRIPT = """
import hashlib, threading
from vtkmuscle.filters import (
    BoneMotion, FibreMetrics, FibreTemplateSource, FibreTransport, FibreTrimmer, FixedPointDetector,
    PathDeformer, SliceMorpher, TautPaths, TemplateFitter,
)
from vtkmuscle.data.arrays import points_of
from vtkmuscle.phantoms import spindle_over_hinge, wrapping_cylinder

def connected(made, *inputs):
    for port, value in enumerate(inputs):
        made.connect(port, value)
    return made

def run(phantom, **parameters):
    (name, muscle), = phantom.muscles.items()
    attachments = phantom.attachments[name]
    posed = dict(rest_bones=phantom.bones, bones=BoneMotion(bones=phantom.bones, motion=phantom.motion))
    fixed = connected(FixedPointDetector(), muscle, phantom.bones, attachments)
    paths = TautPaths(rest_muscle=fixed, **posed)
    deformed = PathDeformer(muscle=fixed, paths=paths, **posed, **parameters)
    fitted = connected(TemplateFitter(), FibreTemplateSource(n_fibres=8), muscle, attachments)
    trimmed = connected(FibreTrimmer(), connected(SliceMorpher(), fitted, muscle), muscle, attachments)
    carried = connected(FibreTransport(), trimmed, muscle, deformed)
    last = connected(FibreMetrics(), carried)
    digest = hashlib.sha256()
    for time in phantom.motion.times[1:3]:
        digest.update(points_of(last.update(time).output).tobytes())
        digest.update(points_of(deformed.update(time).output).tobytes())
    return digest.hexdigest()

JOBS = [
    (spindle_over_hinge, dict(iterations=12)),
    (wrapping_cylinder, dict(iterations=8)),
]
expected = [run(make(), **parameters) for make, parameters in JOBS]
assert len(set(expected)) == len(JOBS)
for one, other in ((0, 1), (0, 0)):
    phantoms = [JOBS[job][0]() for job in (one, other)]
    found, together = {}, threading.Barrier(2)

    def work(place, job):
        together.wait()
        found[place] = run(phantoms[place], **JOBS[job][1])

    threads = [threading.Thread(target=work, args=pair) for pair in enumerate((one, other))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == {0: expected[one], 1: expected[other]}, (one, other)
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
