"""Presets and the number of triangles of PBDDeformer."""

import sys

import numpy as np
import pytest

from vtkmuscle.core.pbd import coarse
from vtkmuscle.data.arrays import field_array, point_array, points_of
from vtkmuscle.filters import BoneMotion, FixedPointDetector, PBDDeformer
from vtkmuscle.filters.deformer.quality import PRESETS
from vtkmuscle.phantoms import spindle_over_hinge


@pytest.fixture(scope="module")
def deformer_of():
    phantom = spindle_over_hinge()
    ((name, muscle),) = phantom.muscles.items()
    fixed = FixedPointDetector()(muscle, phantom.bones, phantom.attachments[name])
    moving = BoneMotion(motion=phantom.motion)
    moving.connect(0, phantom.bones)

    def make(**parameters):
        deformer = PBDDeformer(**parameters)
        deformer.connect(0, fixed)
        deformer.connect(1, moving)
        return deformer

    make.times, make.fixed, make.motion = phantom.motion.times, fixed, phantom.motion
    return make


def test_a_preset_is_its_settings_and_explicit_ones_count_more():
    for name, settings in PRESETS.items():
        made = PBDDeformer(quality=name).parameters()
        assert made == {**PBDDeformer().parameters(), "quality": name, **settings}
        assert PBDDeformer(**made).parameters() == made
        deformer = PBDDeformer()
        deformer.quality = name
        assert deformer.parameters() == made
    assert PBDDeformer(quality="accurate", iterations=10).iterations == 10
    assert PBDDeformer(quality=None).parameters() == PBDDeformer().parameters()


def test_an_unknown_preset_is_refused_with_those_there_are():
    with pytest.raises(
        ValueError, match=r"quality is 'best', but must be one of 'preview', 'balanced', 'acc"
    ):
        PBDDeformer(quality="best")


def test_a_reduced_muscle_carries_the_full_one_near_to_where_it_goes_itself(deformer_of):
    time = deformer_of.times[6]
    full = deformer_of(iterations=100).update(time=time).output
    reduced = (
        deformer_of(iterations=100, max_triangles=600, measure_penetration=True).update(time=time).output
    )
    rest = points_of(deformer_of.fixed)
    assert points_of(reduced).shape == rest.shape
    moved = np.linalg.norm(points_of(full) - rest, axis=1).max()
    apart = np.linalg.norm(points_of(full) - points_of(reduced), axis=1)
    assert np.sqrt((apart**2).mean()) < 0.2 * moved
    assert apart.max() > 1e-3  # it is another solve
    np.testing.assert_allclose(
        point_array(reduced, "Displacement", ""), points_of(reduced) - rest, rtol=0, atol=1e-9
    )
    assert field_array(reduced, "VolumeRatio")[0] == pytest.approx(1.0, abs=1e-6)
    fixed_to = point_array(deformer_of.fixed, "FixedTo", "")
    held = fixed_to >= 0
    np.testing.assert_allclose(points_of(reduced)[held], points_of(full)[held], atol=1e-9)
    assert field_array(reduced, "PenetrationMax")[0] < 0.1


def test_the_number_of_triangles_can_be_changed_and_none_is_too_many(deformer_of):
    time = deformer_of.times[1]
    deformer = deformer_of(iterations=5, max_triangles=600)
    reduced = points_of(deformer.update(time=time).output).copy()
    deformer.max_triangles = 10**6
    full = points_of(deformer.update(time=time).output).copy()
    np.testing.assert_array_equal(full, points_of(deformer_of(iterations=5).update(time=time).output))
    assert not np.array_equal(full, reduced)
    deformer.max_triangles = 600
    np.testing.assert_array_equal(points_of(deformer.update(time=time).output), reduced)


def test_a_muscle_that_falls_apart_is_refused_by_name(deformer_of, monkeypatch):
    def torn(points, triangles, n_coarse, held):
        return points, triangles[: 2 * n_coarse]

    monkeypatch.setattr(coarse, "decimate", torn)
    with pytest.raises(ValueError, match=r"PBDDeformer.max_triangles is .* stay closed; allow more, or"):
        deformer_of(max_triangles=400).update(time=deformer_of.times[1])


def test_a_reduced_muscle_can_start_from_a_coarser_one_still(deformer_of):
    """Without taut fibres: with them each step starts where they carry the muscle."""
    time = deformer_of.times[3]
    settings = {"iterations": 5, "max_triangles": 600, "solver": "anderson", "anisotropy": "off"}
    blended = deformer_of(**settings).update(time=time).output
    started = deformer_of(**settings, start="coarse", coarse_points=100).update(time=time).output
    assert np.abs(points_of(started) - points_of(blended)).max() > 1e-2
    assert field_array(started, "VolumeRatio")[0] == pytest.approx(1.0, abs=1e-6)
    converged = deformer_of(**{**settings, "iterations": 300, "solver": "two-level", "tolerance": 0.0})
    converged = points_of(converged.update(time=time).output)
    assert _rms(points_of(started) - converged) < _rms(points_of(blended) - converged)


def _rms(differences):
    return np.sqrt((differences**2).sum(axis=1).mean())


def test_a_reduced_muscle_says_what_it_needs(deformer_of, monkeypatch):
    monkeypatch.setitem(sys.modules, "fast_simplification", None)
    with pytest.raises(
        ModuleNotFoundError, match=r"PBDDeformer.max_triangles is 600, .* fast-simplification"
    ):
        deformer_of(max_triangles=600).update(time=deformer_of.times[1])
