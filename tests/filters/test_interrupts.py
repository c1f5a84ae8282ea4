"""Ctrl-C while a filter executes, by real signals."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonDataModel import vtkDataObject

from vtkmuscle.data.arrays import Polylines, polylines_from
from vtkmuscle.filters import FibreSmoother


@pytest.fixture(autouse=True)
def ctrl_c_counts():
    """Pytest may itself run where a background job's Ctrl-C is ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


SETTING = """
import os, signal, threading
from vtkmuscle.filters import BoneMotion, FixedPointDetector, PathDeformer, TautPaths
from vtkmuscle.data.arrays import points_of
from vtkmuscle.phantoms import spindle_over_hinge

# A shell's background job ignores Ctrl-C, and what it starts inherits that.
signal.signal(signal.SIGINT, signal.default_int_handler)

phantom = spindle_over_hinge()
(name, muscle), = phantom.muscles.items()
fixed = FixedPointDetector()(muscle, phantom.bones, phantom.attachments[name])

def deformer(**parameters):
    posed = {"rest_bones": phantom.bones, "bones": BoneMotion(bones=phantom.bones, motion=phantom.motion)}
    paths = TautPaths(rest_muscle=fixed, **posed)
    return PathDeformer(muscle=fixed, paths=paths, **posed, **parameters)

def frame(made):
    return points_of(made.update(4.0).output).tobytes()

expected = frame(deformer(iterations=5))
stopped = deformer(iterations=10_000)
"""

FROM_OUTSIDE = """
report, counted, at_signal = stopped.report_progress, [], []
warm = threading.Event()

def count(fraction):
    counted.append(fraction)
    if len(counted) == 20:
        warm.set()
    report(fraction)

def press_ctrl_c():
    warm.wait()
    at_signal.append(len(counted))
    os.kill(os.getpid(), signal.SIGINT)

stopped.report_progress = count
threading.Thread(target=press_ctrl_c).start()
"""

THEN = """
try:
    stopped.update(4.0)
    print("not stopped")
except KeyboardInterrupt:
    print("stopped", len(counted) - at_signal[0])
print(stopped.GetOutputDataObject(0).GetNumberOfPoints())
stopped.iterations = 5
print(frame(stopped) == expected)
"""


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for a process alone")
def test_ctrl_c_stops_within_an_iteration_and_leaves_the_filter_usable():
    done = subprocess.run(
        [sys.executable, "-c", SETTING + FROM_OUTSIDE + THEN],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    stopped, points, usable = done.stdout.splitlines()
    word, iterations = stopped.split()
    # VTK itself tells an observer 1.0 when the filter has returned.
    assert word == "stopped"
    assert int(iterations) <= 1
    assert points == "0"
    assert usable == "True"


def line():
    return polylines_from(Polylines(np.eye(3), np.array([0, 3])))


class Interrupted(VTKPythonAlgorithmBase):
    """A user's source, in which Ctrl-C arrives while VTK asks for its time steps."""

    def __init__(self):
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkPolyData")

    def RequestInformation(self, request, in_info, out_info):
        os.kill(os.getpid(), signal.SIGINT)
        return 1

    def RequestData(self, request, in_info, out_info):
        out_info.GetInformationObject(0).Get(vtkDataObject.DATA_OBJECT()).ShallowCopy(line())
        return 1


def test_ctrl_c_that_vtk_drops_is_an_error():
    source, smoother = Interrupted(), FibreSmoother()
    smoother.SetInputConnection(source.GetOutputPort())
    with pytest.raises(RuntimeError, match="FibreSmoother: an algorithm upstream failed"):
        smoother.update()


def test_ctrl_c_stops_a_filter_at_once():
    reached = []

    class Pressed(FibreSmoother):
        """Ctrl-C is pressed while it executes."""

        def execute(self, fibres, muscle, attachments):
            os.kill(os.getpid(), signal.SIGINT)
            reached.append("behind Ctrl-C")

    with pytest.raises(KeyboardInterrupt):
        Pressed().apply(line())
    assert not reached
