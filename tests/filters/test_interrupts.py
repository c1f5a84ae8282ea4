"""Ctrl-C in a script, by real signals in child processes; and signals held back while an observer runs."""

import os
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonCore import vtkObject
from vtkmodules.vtkCommonDataModel import vtkDataObject

from vtkmuscle.data.arrays import Polylines, polylines_from
from vtkmuscle.filters import FibreSmoother
from vtkmuscle.filters.base.running import failure_messages_off, interrupts_deferred, silence_after_failure


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

IN_AN_OBSERVER = """
counted, at_signal = [], []

def observe(caller, _event):
    counted.append(caller.GetProgress())
    if len(counted) == 20:
        at_signal.append(len(counted))
        os.kill(os.getpid(), signal.SIGINT)

observer = stopped.AddObserver("ProgressEvent", observe)
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
@pytest.mark.parametrize("ctrl_c", [FROM_OUTSIDE, IN_AN_OBSERVER], ids=["while computing", "in an observer"])
def test_ctrl_c_stops_within_an_iteration_and_leaves_the_filter_usable(ctrl_c):
    done = subprocess.run(
        [sys.executable, "-c", SETTING + ctrl_c + THEN],
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


def test_a_signal_is_held_back_until_the_block_is_left():
    reached = []
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012 -- where it is raised is the point
        with interrupts_deferred():
            os.kill(os.getpid(), signal.SIGINT)
            reached.append("end of the block")
        reached.append("behind the block")
    assert reached == ["end of the block"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


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


def test_vtk_does_not_lose_ctrl_c_between_its_calls(capfd):
    source, smoother = Interrupted(), FibreSmoother()
    smoother.SetInputConnection(source.GetOutputPort())
    with pytest.raises(KeyboardInterrupt):
        smoother.update()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert capfd.readouterr().err == ""


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


def test_ctrl_c_is_not_lost_beside_an_error():
    with pytest.raises(KeyboardInterrupt), interrupts_deferred():  # noqa: PT012 -- both in one block
        os.kill(os.getpid(), signal.SIGINT)
        raise ValueError("within")


def test_an_error_in_the_block_puts_the_handler_back():
    with pytest.raises(ValueError, match="within"), interrupts_deferred():
        raise ValueError("within")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_outside_the_main_thread_handlers_are_left_alone():
    seen = []

    def work():
        with interrupts_deferred():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [signal.default_int_handler]


def test_an_ignored_ctrl_c_stays_ignored():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with interrupts_deferred():
            os.kill(os.getpid(), signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_messages_come_back_when_threads_fail_across_each_other():
    """One thread's block begins after the failure in another's, and ends after that."""
    assert vtkObject.GetGlobalWarningDisplay() == 1
    failed, entered, left = threading.Event(), threading.Event(), threading.Event()

    def other():
        failed.wait()
        with failure_messages_off():
            entered.set()
            left.wait()
            silence_after_failure()

    thread = threading.Thread(target=other)
    thread.start()
    with failure_messages_off():
        silence_after_failure()
        assert vtkObject.GetGlobalWarningDisplay() == 0
        failed.set()
        entered.wait()
    left.set()
    thread.join()
    assert vtkObject.GetGlobalWarningDisplay() == 1


def test_a_failure_elsewhere_is_shown():
    silence_after_failure()
    assert vtkObject.GetGlobalWarningDisplay() == 1
