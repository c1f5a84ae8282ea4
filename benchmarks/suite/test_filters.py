"""Filters, one by one, on a muscle of the phantom hip."""

from __future__ import annotations

import pytest

from vtkmuscle.filters import (
    BoneMotion,
    FibreMetrics,
    FibreSmoother,
    FibreTemplateSource,
    FibreTransport,
    FibreTrimmer,
    FibreTubes,
    FixedPointDetector,
    LinearBlendFibres,
    SliceMorpher,
    TemplateFitter,
)
from vtkmuscle.pipelines import decompose

FEW = 3


def test_fixed_points(measured, hip):
    measured(lambda: FixedPointDetector()(hip.muscle, hip.phantom.bones, hip.areas), rounds=FEW)


def test_bone_motion(measured, hip):
    bones = BoneMotion(motion=hip.phantom.motion)
    bones.connect(0, hip.phantom.bones)
    first, last = float(hip.phantom.motion.times[0]), float(hip.phantom.motion.times[-1])
    measured(lambda: (bones.update(time=last), bones.update(time=first)), rounds=FEW)


def test_template_fitter(measured, hip):
    template = FibreTemplateSource()()
    measured(lambda: TemplateFitter()(template, hip.muscle, hip.areas), rounds=FEW)


# The iliacus is bent; that planes do not suit it is no matter here.
@pytest.mark.filterwarnings("ignore:SliceMorpher. the muscle is bent too much")
@pytest.mark.parametrize("method", ["plane", "harmonic"])
def test_slice_morpher(measured, hip, method):
    fitted = TemplateFitter()(FibreTemplateSource()(), hip.muscle, hip.areas)
    measured(lambda: SliceMorpher(method=method)(fitted, hip.muscle, hip.areas), rounds=FEW)


def test_fibre_trimmer(measured, hip):
    fitted = TemplateFitter()(FibreTemplateSource()(), hip.muscle, hip.areas)
    morphed = SliceMorpher()(fitted, hip.muscle, hip.areas)
    measured(lambda: FibreTrimmer()(morphed, hip.muscle, hip.areas), rounds=FEW)


def test_fibre_smoother(measured, hip):
    measured(lambda: FibreSmoother()(hip.hundred_fibres, hip.muscle), rounds=FEW)


def test_all_of_decompose(measured, hip):
    measured(lambda: decompose(hip.muscle, hip.areas, n_fibres=100).update(), rounds=FEW)


def test_fibre_transport(measured, hip):
    """The weights are there; what is measured is a frame."""
    transport = FibreTransport()

    def frame() -> object:
        transport.Modified()
        return transport(hip.hundred_fibres, hip.marked, hip.muscle)

    measured(frame, rounds=FEW)


def test_fibre_metrics(measured, hip):
    measured(lambda: FibreMetrics()(hip.hundred_fibres, hip.muscle), rounds=FEW)


def test_fibre_tubes(measured, hip):
    measured(lambda: FibreTubes()(hip.hundred_fibres), rounds=FEW)


def test_linear_blend_fibres(measured, hip):
    bones = BoneMotion(motion=hip.phantom.motion)
    bones.connect(0, hip.phantom.bones)
    moved = bones.update(time=float(hip.phantom.motion.times[-1])).output
    measured(
        lambda: LinearBlendFibres(origin="pelvis", insertion="femur")(hip.hundred_fibres, moved), rounds=FEW
    )


@pytest.mark.parametrize("quality", ["preview", "balanced"])
def test_path_deformer_over_5_frames(measured, hip, quality):
    measured(lambda: hip.frames(5, quality=quality), rounds=FEW)


@pytest.mark.parametrize("collision", ["off", "sdf"])
@pytest.mark.parametrize("quality", ["preview", "balanced"])
def test_pbd_deformer_over_5_frames(measured, hip, quality, collision):
    measured(lambda: hip.frames(5, deformer="pbd", quality=quality, collision=collision), rounds=FEW)


def test_algorithm_2_over_5_frames(measured, hip):
    measured(lambda: hip.frames(5, deformer="pbd", quality="published", iterations=10), rounds=FEW)
