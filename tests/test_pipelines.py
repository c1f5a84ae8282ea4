"""The ready-made chains are those of the single filters, and hold together by themselves."""

import gc

import numpy as np
import pytest

from vtkmuscle import filters
from vtkmuscle.data.arrays import cell_array, points_of, polylines_of
from vtkmuscle.data.attachments import Aponeurosis, aponeuroses_data, attachments_from
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.pipelines import DEFORMERS, FIBRE_SETTINGS, MusclePipeline, decompose, deform
from vtkmuscle.run import muscle_pipeline


@pytest.fixture
def muscle(scene):
    return scene.muscles["spindle"].surface


@pytest.fixture
def attachments(scene):
    return attachments_from(scene.muscles["spindle"].attachments)


def test_the_settings_of_fibres_are_all_parameters_of_the_chain(muscle, attachments):
    chain = [decompose(muscle, attachments, template="parallel")]
    while chain[-1].GetNumberOfInputPorts():
        chain.append(chain[-1].GetInputAlgorithm(0, 0))
    declared = {name: one for f in chain for name, one in f.parameter_declarations.items()}
    declared["course"] = filters.FibreSource.parameter_declarations["course"]
    assert declared == FIBRE_SETTINGS
    with pytest.raises(TypeError, match="decompose has no setting 'n_fibre'; did you mean 'n_fibres'"):
        decompose(muscle, attachments, n_fibre=3)


def test_settings_of_sections_do_not_go_with_straight_fibres(muscle, attachments):
    assert isinstance(decompose(muscle, attachments, n_fibres=5, course="straight"), filters.FibreSource)
    assert isinstance(
        decompose(muscle, attachments, template="fan", course="sections"), filters.FibreSmoother
    )
    with pytest.raises(ValueError, match="template is a setting of fibres through sections"):
        decompose(muscle, attachments, template="fan", course="straight")


def chain(scene, muscle, attachments, **settings):
    fibres = decompose(muscle, attachments, n_fibres=6, resolution=5)
    return deform(muscle, scene.bones_data(), scene.motion, attachments, fibres=fibres, **settings)


def test_a_chain_lives_by_its_last_filter_alone(scene, muscle, attachments):
    last = chain(scene, muscle, attachments, iterations=2)
    gc.collect()
    first = points_of(last.update(time=10.0).output)
    gc.collect()
    np.testing.assert_array_equal(points_of(last.update(time=10.0).output), first)
    assert np.abs(first - points_of(muscle)).max() > 1.0


FEW_FIBRES = {"n_fibres": 6, "resolution": 5}


def lengths(metrics, time=10.0):
    return np.array(cell_array(metrics.update(time=time).output, "Length", "test"))


def test_a_muscle_pipeline_is_the_filters_connected_by_hand(scene, muscle, attachments):
    bones, motion = scene.bones_data(), scene.motion
    pipeline = MusclePipeline(
        muscle, bones, motion, attachments, fixing={}, fibres=FEW_FIBRES, solver={"iterations": 4}
    )
    fixed = FixedPointDetector()(muscle, bones, attachments)
    fibres = decompose(muscle, attachments, **FEW_FIBRES).update().output
    deformed = deform(fixed, bones, motion, attachments, fibres=fibres, fixing=None, iterations=4)
    moved = deformed.update(time=10.0).output
    carried = deformed.update(time=10.0, port=1).output
    expected = np.array(cell_array(filters.FibreMetrics()(carried, moved), "Length", "test"))
    np.testing.assert_array_equal(lengths(pipeline.metrics), expected)
    np.testing.assert_array_equal(points_of(pipeline.deformer.update(time=10.0).output), points_of(moved))
    assert pipeline.taut_paths is pipeline.deformer.paths
    assert pipeline.rest_paths is pipeline.fibres is pipeline.taut_paths.rest_fibres
    with_fibres = MusclePipeline(fixed, bones, motion, fibres=fibres, solver={"iterations": 4})
    np.testing.assert_array_equal(lengths(with_fibres.metrics), expected)


def test_a_muscle_pipeline_of_paths_pulls_the_fibres_taut(scene, muscle, attachments):
    bones, motion = scene.bones_data(), scene.motion
    pipeline = MusclePipeline(
        muscle, bones, motion, attachments, deformer="none", fixing={}, fibres=FEW_FIBRES
    )
    assert pipeline.deformer is None
    assert pipeline.metrics.fibres is pipeline.taut_paths
    fixed = FixedPointDetector(muscle=muscle, bones=bones, attachments=attachments)
    posed = {"rest_bones": bones, "bones": filters.BoneMotion(bones=bones, motion=motion)}
    rest = {"rest_fibres": decompose(fixed, attachments, **FEW_FIBRES), "rest_muscle": fixed}
    taut = filters.TautPaths(**rest, **posed, attachments=attachments)
    found = points_of(pipeline.metrics.update(time=10.0).output)
    np.testing.assert_array_equal(found, points_of(taut.update(time=10.0).output))


def test_settings_of_a_muscle_pipeline_reach_their_filters_or_are_refused(scene, muscle, attachments):
    def made(**settings):
        return MusclePipeline(muscle, scene.bones_data(), scene.motion, attachments, **settings)

    own = {"weight_tolerance": 0.1, "smoothing_passes": 2}
    pipeline = made(fixing={"distance": 2.0}, fibres={**FEW_FIBRES, **own}, paths={"resolution": 20})
    assert pipeline.fixed.distance == 2.0
    assert pipeline.fibres.smoothing_passes == 2
    assert pipeline.taut_paths.resolution == 20
    transport = made(fixing={}, fibres={**FEW_FIBRES, **own}, deformer="pbd").metrics.fibres
    assert isinstance(transport, filters.FibreTransport)
    assert transport.weight_tolerance == 0.1
    without = made(fixing={})
    assert (without.fibres, without.metrics) == (None, None)
    with pytest.raises(ValueError, match="deformer is 'volumes', but must be one of 'paths', 'pbd', 'none'"):
        made(deformer="volumes")
    sheets = aponeuroses_data([Aponeurosis("distal", np.eye(3))])
    with pytest.raises(ValueError, match="need a deformed muscle, but deformer is 'none'"):
        made(fixing={}, fibres={}, deformer="none", aponeuroses=sheets)
    with pytest.raises(TypeError, match="prone"):
        made(fibres={"prone": 0.1})


@pytest.mark.parametrize(("quality", "resolution", "rounds"), [("preview", 24, 2), ("accurate", 64, 20)])
def test_a_preset_sets_numbers_of_all_stages_and_explicit_numbers_count_more(
    scene, muscle, attachments, quality, resolution, rounds
):
    parts = muscle, scene.bones_data(), scene.motion, attachments
    preset = MusclePipeline(*parts, fixing={}, quality=quality)
    assert (preset.taut_paths.resolution, preset.deformer.iterations) == (resolution, rounds)
    own = {"paths": {"resolution": 10}, "solver": {"iterations": 4}}
    explicit = MusclePipeline(*parts, fixing={}, quality=quality, **own)
    assert (explicit.taut_paths.resolution, explicit.deformer.iterations) == (10, 4)


def test_every_deformer_has_its_stages_and_no_others(scene, muscle, attachments):
    parts = muscle, scene.bones_data(), scene.motion, attachments
    made = {kind: MusclePipeline(*parts, fixing={}, fibres=FEW_FIBRES, deformer=kind) for kind in DEFORMERS}
    kinds = {kind: type(pipeline.deformer) for kind, pipeline in made.items()}
    assert kinds == {"paths": filters.PathDeformer, "pbd": filters.PBDDeformer, "none": type(None)}
    assert made["pbd"].taut_paths is None, "nothing needs them"
    with_paths = MusclePipeline(*parts, fixing={}, fibres=FEW_FIBRES, deformer="pbd", paths={})
    assert with_paths.taut_paths.rest_fibres is with_paths.fibres
    assert with_paths.metrics.paths is with_paths.taut_paths


def test_the_pipeline_of_a_scene_has_the_scenes_settings(scene):
    pipeline = muscle_pipeline(scene, "spindle")
    assert pipeline.deformer.iterations == scene.solver["iterations"]
    run = scene.run(frames="0:3", figures=False)
    np.testing.assert_allclose(
        lengths(pipeline.metrics, run.times[2]), run.fibre_lengths["spindle"][2], rtol=0.0, atol=0.02
    )


@pytest.mark.filterwarnings("ignore:SliceMorpher. the muscle is bent too much")
@pytest.mark.parametrize("published", ["kohout2012", "kohout2014"])
def test_published_fibres_run_from_area_to_area_of_any_muscle(hip, published):
    for name, muscle in hip.muscles.items():
        chain = decompose(muscle, hip.attachments[name], published=published, n_fibres=12)
        lines = polylines_of(chain.output, name)
        assert len(lines) == 12
        assert np.isfinite(lines.points).all()
        assert (np.diff(lines.offsets) >= 3).all()


def test_settings_beside_the_name_of_published_fibres_count_more(hip):
    muscle, areas = hip.muscles["iliacus"], hip.attachments["iliacus"]
    assert decompose(muscle, areas, published="kohout2014").spreading == 0.0
    assert decompose(muscle, areas, published="kohout2014", spreading=1.0).spreading == 1.0
    with pytest.raises(ValueError, match="no published fibres 'kohout2013'; did you mean"):
        decompose(muscle, areas, published="kohout2013")
