"""Ctrl-C while a filter executes, by real signals."""

import os
import signal
import threading

import numpy as np
import pytest
from shapes import lines_of
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonDataModel import vtkDataObject

from vtkmuscle.data.arrays import points_of
from vtkmuscle.filters import FibreSmoother
from vtkmuscle.pipelines import deform


def test_ctrl_c_stops_within_an_iteration_and_leaves_the_filter_usable(spindle):
    muscle, areas = spindle.muscles["spindle"], spindle.attachments["spindle"]

    def made(iterations):
        return deform(muscle, spindle.bones, spindle.motion, areas, iterations=iterations)

    stopped = made(10_000)
    report, counted, at_signal, warm = stopped.report_progress, [], [], threading.Event()

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
    with pytest.raises(KeyboardInterrupt):
        stopped.update(4.0)
    assert len(counted) - at_signal[0] <= 1
    assert stopped.GetOutputDataObject(0).GetNumberOfPoints() == 0
    stopped.iterations = 5
    expected = points_of(made(5).update(4.0).output)
    np.testing.assert_array_equal(points_of(stopped.update(4.0).output), expected)


def line():
    return lines_of([np.eye(3)])


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
