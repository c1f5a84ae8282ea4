import json
import warnings

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.interpolate import BPoly
from tiny_scene import TEMPLATE

from vtkmuscle.core.template import KINDS, TEMPLATES, bezier, read_template, sobol_points, template_from
from vtkmuscle.data.arrays import field_array, points_of
from vtkmuscle.filters.fibre_template_source import FibreTemplateSource

unit = st.floats(0.0, 1.0)


@pytest.fixture(params=KINDS)
def template(request):
    return TEMPLATES[request.param]


@settings(max_examples=40)
@given(r=unit, s=unit)
@example(r=0.23435028491676452, s=0.125)  # the weights of the corners add up to a little more than 1
def test_fibres_stay_in_the_cube_and_climb(r, s):
    for template in TEMPLATES.values():
        points = template.fibres([r], [s], np.linspace(0, 1, 30))[0]
        assert points.min() >= 0.0
        assert points.max() <= 1.0
        assert (np.diff(points[:, 2]) > 0.0).all()


def test_a_template_is_its_own_mirror_image(template):
    for sheets in template.parts:
        np.testing.assert_allclose(sheets[:, ::-1] * [1.0, -1.0, 1.0] + [0.0, 1.0, 0.0], sheets, atol=1e-12)


def test_fibres_begin_on_the_origin_area_and_end_on_the_insertion_area(template, rng):
    r, s = rng.random((2, 200))
    ends = template.fibres(r, s, [0.0, 1.0])
    part = np.minimum((r * len(template.parts)).astype(int), len(template.parts) - 1)
    for end, areas in ((0, template.areas(0)), (1, template.areas(-1))):
        for area, points in ((areas[i], ends[part == i, end]) for i in range(len(areas))):
            # A parallelogram: corners 1 and 3 span it from corner 0.
            assert np.allclose(area[0] + area[2], area[1] + area[3])
            across = np.column_stack([area[1] - area[0], area[3] - area[0]])
            found, *_ = np.linalg.lstsq(across, (points - area[0]).T, rcond=None)
            assert np.allclose(across @ found, (points - area[0]).T, atol=1e-14)
            assert found.min() >= -1e-14
            assert found.max() <= 1 + 1e-14


@pytest.mark.parametrize(("kind", "width"), [("pennate", 1.0), ("bipennate", 0.5)])
def test_pennate_fibres_are_straight_parallel_and_equally_long(kind, width, rng):
    r, s = rng.random((2, 50)) * [[0.5], [1.0]]
    points = TEMPLATES[kind].fibres(r, s, np.linspace(0, 1, 7))
    assert np.allclose(np.diff(points, axis=1), np.array([width, 0.0, 0.5]) / 6, atol=1e-14)


@settings(max_examples=30)
@given(degree=st.integers(1, 4), seed=st.integers(0, 1000))
def test_bezier_agrees_with_scipy(degree, seed):
    rng = np.random.default_rng(seed)
    polygons, t = rng.random((3, degree + 1, 3)), rng.random(5)
    expected = [BPoly(polygon[:, None, :], [0, 1])(t) for polygon in polygons]
    assert np.allclose(bezier(polygons, t), expected, atol=1e-14)


@pytest.mark.parametrize("n", [1, 2, 3, 100, 128, 1000])
def test_any_number_of_sobol_points_without_a_warning(n):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        points = sobol_points(n)
    assert points.shape == (n, 2)
    assert points.min() > 0.0
    assert points.max() < 1.0
    assert np.array_equal(points, sobol_points(n))


def test_a_power_of_two_of_sobol_points_puts_one_in_each_cell():
    assert len(np.unique(np.floor(sobol_points(64) * [8, 8]).astype(int), axis=0)) == 64
    assert np.allclose(np.sort(sobol_points(64), axis=0), (np.arange(64)[:, None] + 0.5) / 64)


@pytest.mark.parametrize("kind", list(TEMPLATES))
@pytest.mark.parametrize("suffix", ["json", "toml"])
def test_every_kind_can_be_written_to_a_file_and_read_again(kind, suffix, tmp_path):
    parts = [sheets.tolist() for sheets in TEMPLATES[kind].parts]
    file = tmp_path / f"own.{suffix}"
    if suffix == "json":
        file.write_text(json.dumps({"parts": [{"sheets": sheets} for sheets in parts]}))
    else:
        file.write_text("".join(f"[[parts]]\nsheets = {sheets}\n" for sheets in parts))
    here, there = (
        FibreTemplateSource(n_fibres=20, **source).update().output
        for source in ({"template": kind}, {"template_file": str(file)})
    )
    assert np.array_equal(points_of(here), points_of(there))
    for area in ("OriginArea", "InsertionArea"):
        assert np.array_equal(field_array(here, area), field_array(there, area))


def test_a_file_of_one_part_needs_no_parts(tmp_path):
    file = tmp_path / "strap.toml"
    file.write_text(TEMPLATE)
    assert np.array_equal(read_template(file).fibres([0.0], [0.5], [0.0, 0.5, 1.0])[0, 1], [0.15, 0.5, 0.5])


def strap(**changes):
    sheets = [[[0, 0, z], [1, 0, z], [1, 1, z], [0, 1, z]] for z in (0, 0.5, 1)]
    for place, value in changes.items():
        *path, last = (int(i) for i in place[1:].split("_"))
        target = sheets
        for i in path:
            target = target[i]
        target[last] = value
    return {"sheets": sheets}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ([], "there must be the key 'sheets', or the key 'parts'"),
        ({"parts": []}, "the key 'parts' with a list of tables"),
        ({"sheet": []}, "must be a table with the single key 'sheets'"),
        ({"sheets": 3}, "sheets must be a list of 3 to 5 sheets"),
        ({"sheets": strap()["sheets"][:2]}, "must be a list of 3 to 5"),
        (strap(_1_2=[0, 1]), "each of 4 corners with three numbers"),
        (strap(_1_2=[0, 1, 1.2]), "must be points of the unit cube"),
        (strap(_1_2=[0, 1, float("nan")]), "must be points of the unit cube"),
        (strap(_0=[[0, 0, 0]] * 4), "the corners of the origin area enclose no area"),
        (strap(_2=strap()["sheets"][0]), "the origin area and the insertion area are the same"),
        ({"parts": [strap(), {}]}, r"parts\[1\] must be a table with the single key 'sheets'"),
        ({"parts": [strap(), {"sheets": strap()["sheets"][:1] * 3 + strap()["sheets"][2:]}]}, "same number"),
    ],
)
def test_errors_say_where_and_what_is_allowed(content, message):
    with pytest.raises(ValueError, match=f"own: .*{message}|own: {message}"):
        template_from(content, "own")


def test_files_that_are_none_are_errors_of_the_source(tmp_path):
    with pytest.raises(ValueError, match=r"Source: template_file: .*missing.toml cannot be read"):
        FibreTemplateSource(template_file=str(tmp_path / "missing.toml")).update()
    for name, message in (("own.yaml", "must be a .toml or a .json"), ("own.json", "cannot be read as JSON")):
        (tmp_path / name).write_text(TEMPLATE)
        with pytest.raises(ValueError, match=message):
            FibreTemplateSource(template_file=str(tmp_path / name)).update()
