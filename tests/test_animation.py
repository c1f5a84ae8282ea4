"""A run as an animation of USD (extra ``usd``)."""

import dataclasses

import numpy as np
import pytest
from commands import refused, vtkmuscle_

from vtkmuscle import Scene, phantoms
from vtkmuscle.data.arrays import points_of, polylines_of

METRES = 0.001


@pytest.fixture(scope="module")
def result():
    scene = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=6)
    (muscle,) = scene.muscles.values()
    twice = dataclasses.replace(scene, muscles={"long head": muscle, "long_head": muscle})
    return twice.run(frames="0:11:5", figures=False)


def opened(path):
    return pytest.importorskip("pxr.Usd", reason="the extra usd is not installed").Stage.Open(str(path))


def points_at(stage, path, frame):
    from pxr import UsdGeom

    prim = stage.GetPrimAtPath(path)
    points = np.array(UsdGeom.PointBased(prim).GetPointsAttr().Get(frame))
    moved = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(frame))
    return points @ moved[:3, :3] + moved[3, :3]


@pytest.mark.optional
@pytest.mark.parametrize("suffix", ["usda", "usdc"])
def test_a_frame_of_the_animation_is_a_frame_of_the_run(result, tmp_path, suffix):
    pytest.importorskip("pxr", reason="the extra usd is not installed")
    stage = opened(result.write_usd(tmp_path / f"run.{suffix}"))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, 2)
    root = f"/{result.name}"
    for i, frame in enumerate(result.frames):
        # Both names are one to USD.
        for name, prim in (("long head", "long_head"), ("long_head", "long_head_")):
            expected = METRES * points_of(result.muscle(name, frame=frame))
            np.testing.assert_allclose(points_at(stage, f"{root}/muscles/{prim}", i), expected, atol=1e-6)
            fibres = polylines_of(result.fibres(name, frame=frame), "fibres").points
            np.testing.assert_allclose(
                points_at(stage, f"{root}/fibres/{prim}", i), METRES * fibres, atol=1e-6
            )
        bones = result.bones(frame=frame)
        for name in bones.keys():  # noqa: SIM118 -- a MultiBlock iterates over blocks
            expected = METRES * points_of(bones[name])
            np.testing.assert_allclose(points_at(stage, f"{root}/bones/{name}", i), expected, atol=1e-6)


@pytest.mark.optional
def test_fibres_have_the_colours_of_their_strain_also_as_tubes(result, tmp_path):
    pytest.importorskip("pxr", reason="the extra usd is not installed")
    stage = opened(result.write_usd(tmp_path / "run.usdc", tubes=True))
    tube = stage.GetPrimAtPath(f"/{result.name}/fibres/long_head")
    assert tube.GetTypeName() == "Mesh"
    red, _, blue = np.array(tube.GetAttribute("primvars:displayColor").Get(2)).T
    shorter = (
        result["long head"].fibre_lengths[-1] < polylines_of(result.rest_fibres("long head"), "").lengths
    )
    assert shorter.all() == bool((blue > red).all())  # blue is shorter
    assert shorter.all() or not shorter.any()
    # A tube is about its fibre.
    lines = polylines_of(result.fibres("long head", frame=result.frames[2]), "fibres")
    near = np.linalg.norm(points_at(stage, tube.GetPath(), 2)[:, None] - METRES * lines.points, axis=2).min(
        axis=1
    )
    assert near.max() < 0.006 * METRES * lines.lengths.mean()


def test_another_suffix_is_refused(result, tmp_path):
    with pytest.raises(ValueError, match=r"page\.gltf: an animation is a file of USD.*\.usdc"):
        result.write_usd(tmp_path / "page.gltf")


@pytest.mark.optional
def test_a_format_that_is_not_written_is_refused_before_the_scene_is_run(tmp_path, monkeypatch):
    pytest.importorskip("pxr", reason="the extra usd is not installed")
    Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=6).save(tmp_path)
    monkeypatch.setattr(Scene, "run", None)
    said = refused("export", tmp_path / "scene.toml", tmp_path / "run.usdz")
    assert "an animation is a file of USD" in said


@pytest.mark.optional
def test_the_command_line_replaces_its_own_animation_only(result, tmp_path):
    pytest.importorskip("pxr", reason="the extra usd is not installed")
    out = tmp_path / "run.usda"
    Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=6).save(tmp_path / "scene")
    export = "export", tmp_path / "scene/scene.toml", out
    out.write_text("of the user")
    refused(*export)
    assert out.read_text() == "of the user"
    out.unlink()
    done = vtkmuscle_(*export)
    assert "wrote" in done.output
    assert len(opened(out).GetPrimAtPath("/spindle_over_hinge").GetChildren()) == 3
