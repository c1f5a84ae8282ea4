"""Filters on a plotter follow the pipeline's time."""

import numpy as np
import pytest
import pyvista as pv
from vtkmodules.vtkFiltersGeometry import vtkCompositeDataGeometryFilter

from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.data.arrays import blocks_of, points_of
from vtkmuscle.filters import BoneMotion, FibreTemplateSource, FibreTubes
from vtkmuscle.pipelines import deform
from vtkmuscle.plotting import can_render, show_time

pytestmark = pytest.mark.skipif(can_render() is not None, reason=str(can_render()))


@pytest.fixture
def plotter():
    made = pv.Plotter(off_screen=True, window_size=(64, 64))
    yield made
    made.close()


def shown(actor):
    return points_of(actor.GetMapper().GetInputDataObject(0, 0))


def chain(phantom, **solver):
    muscle, areas = phantom.muscles["spindle"], phantom.attachments["spindle"]
    return deform(muscle, phantom.bones, phantom.motion, areas, iterations=2, **solver)


def moving(phantom):
    bones = BoneMotion(motion=phantom.motion)
    bones.connect(0, phantom.bones)
    return bones


@pytest.mark.parametrize("smooth_shading", [False, True])
def test_filters_and_what_vtk_makes_of_them_go_to_the_time(spindle, plotter, smooth_shading):
    bones, surface = moving(spindle), vtkCompositeDataGeometryFilter()
    surface.SetInputConnection(bones.GetOutputPort())
    muscle = plotter.add_mesh(chain(spindle), smooth_shading=smooth_shading)
    skeleton = plotter.add_mesh(surface, smooth_shading=smooth_shading)
    still = plotter.add_mesh(pv.Sphere())
    for time in (10.0, 40.0, 3.0, 10.0):
        show_time(plotter, time)
        assert np.array_equal(shown(muscle), points_of(chain(spindle).update(time=time).output))
        blocks = blocks_of(moving(spindle).update(time=time).output)
        assert np.array_equal(shown(skeleton), np.vstack([points_of(block) for _, block in blocks]))
    assert np.array_equal(shown(still), pv.Sphere().points)


def test_a_slider_moves_them(spindle, plotter):
    muscle = plotter.add_mesh(chain(spindle))
    slider = plotter.add_slider_widget(lambda time: show_time(plotter, time), (0.0, 40.0), value=20.0)
    assert shown(muscle) == pytest.approx(points_of(chain(spindle).update(time=20.0).output), abs=0.02)
    slider.GetRepresentation().SetValue(7.0)
    slider.InvokeEvent("EndInteractionEvent")
    assert shown(muscle) == pytest.approx(points_of(chain(spindle).update(time=7.0).output), abs=0.02)


def test_a_chain_is_refused_with_what_to_draw_instead(plotter):
    tubes = FibreTemplateSource(n_fibres=3) >> FibreTubes(radius=0.1)
    with pytest.raises(TypeError, match=r"add_mesh\(chain\.last\)"):
        plotter.add_mesh(tubes)
    assert np.array_equal(shown(plotter.add_mesh(tubes.last)), points_of(tubes.output))


def test_what_a_filter_raises_is_raised(spindle, plotter):
    deformer = chain(spindle)
    plotter.add_mesh(deformer, smooth_shading=True)
    deformer.GetInputAlgorithm(3, 0).motion = hinge("no bone", (0, 0, 0), (1, 0, 0), [0.0, 10.0])
    with pytest.raises(ValueError, match="the motion moves 'no bone'"):
        show_time(plotter, 5.0)
