"""StiffTendons: ends of fibres between aponeuroses, at constant distances from the bones along the paths."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from shapes import lines_of

from examples import PHANTOM, aponeuroses
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.data.arrays import add_arrays, checked_surface, points_of, shallow_copy, with_points
from vtkmuscle.filters import FibreTransport, StiffTendons
from vtkmuscle.pipelines import MusclePipeline

#: By how much the paths get shorter, at their ends [mm].
SHORTER = 4.0


@pytest.fixture
def fibres():
    share = np.linspace(0.0, 1.0, 5)[:, None]
    return lines_of([(1.0 - share) * [-6.0, y, 0.0] + share * [6.0, y, 2.0] for y in (-2.0, 2.0)])


def paths(shorter=0.0):
    """Return three straight paths along x, their last ends moved back."""
    t = np.linspace(0.0, 1.0, 13)[:, None]
    rest = lines_of([(1.0 - t) * [-18.0, y, 0.0] + t * [18.0, y, 0.0] for y in (-3.0, 0.0, 3.0)])
    moved = with_points(rest, (points_of(rest) - np.tile(shorter * t, (3, 1)) * [1.0, 0.0, 0.0]))
    add_arrays(moved, points={"RestPosition": points_of(rest)})
    return moved


def held(fibres, muscle, taut, rest=None, deformed=None):
    inputs = {"rest_muscle": muscle, "deformed_muscle": muscle if deformed is None else deformed}
    return StiffTendons(fibres=fibres, rest_fibres=rest or fibres, paths=taut, **inputs).apply()


def test_at_rest_nothing_moves(fibres, muscle):
    assert_allclose(held(fibres, muscle, paths()).points, points_of(fibres), atol=1e-6)


def test_the_fibres_take_all_of_what_the_paths_become_shorter_by(fibres, muscle):
    add_arrays(fibres, cells={"Own": np.array([3.0, 4.0])})
    moved = held(fibres, muscle, paths(SHORTER))
    shift = np.tile(np.linspace(0.0, 1.0, 5)[:, None] * [-SHORTER, 0.0, 0.0], (2, 1))
    assert_allclose(moved.points - points_of(fibres), shift, atol=1e-6)
    assert_allclose(moved.cell_data["Own"], [3.0, 4.0])


def test_an_end_on_a_part_that_is_fixed_to_a_bone_stays_with_the_part(muscle):
    """Whatever the paths do there: the points that the muscle takes it to count."""
    share = np.linspace(0.0, 1.0, 5)[:, None]
    top = points_of(muscle)[points_of(muscle)[:, 2].argmax()]
    line = lines_of([(1.0 - share) * [-6.0, 0.0, 0.0] + share * top])
    free, fixed = shallow_copy(muscle), shallow_copy(muscle)
    add_arrays(free, points={"FixedTo": np.full(muscle.GetNumberOfPoints(), -1, dtype=np.int32)})
    add_arrays(fixed, points={"FixedTo": np.where(points_of(muscle)[:, 2] > 10.0, 0, -1).astype(np.int32)})
    tendons, off = StiffTendons(rest_fibres=line, deformed_muscle=muscle, paths=paths(SHORTER)), []
    for tendons.fibres, tendons.rest_muscle in ((line, free), (line, fixed)):
        off.append(np.linalg.norm(points_of(tendons.output)[-1] - top))
    assert off[1] < 1e-9
    assert off[0] > 1.0


def test_fibres_are_no_farther_outside_of_the_muscle_than_at_rest(fibres, muscle):
    thinner = with_points(muscle, points_of(muscle) * [1.0, 0.3, 0.3])
    wide = with_points(fibres, points_of(fibres) * [1.0, 7.0, 1.0])
    solid = solids_of(*checked_surface(thinner, "test"))
    assert solid.distances(points_of(wide)).max() > 1.0
    assert solids_of(*checked_surface(muscle, "test")).distances(points_of(wide)).max() <= 0.0
    assert solid.distances(held(wide, muscle, paths(), deformed=thinner).points).max() <= 1e-9


def test_a_pipeline_holds_fibres_between_aponeuroses_and_no_others():
    muscle, areas = PHANTOM.muscles["spindle"], PHANTOM.attachments["spindle"]
    settings = {"fixing": {}, "fibres": {"n_fibres": 8, "resolution": 6}}
    parts = muscle, PHANTOM.bones, PHANTOM.motion, areas
    tendons = MusclePipeline(*parts, aponeuroses=aponeuroses(), **settings).metrics.fibres
    assert isinstance(tendons, StiffTendons)
    assert isinstance(tendons.fibres, FibreTransport)
    moved = points_of(tendons.fibres.update(time=20.0).output)
    assert np.abs(points_of(tendons.update(time=20.0).output) - moved).max() > 0.1
    from_bone_to_bone = MusclePipeline(*parts, **settings)
    assert from_bone_to_bone.metrics.GetInputAlgorithm(0, 0) is from_bone_to_bone.deformer
