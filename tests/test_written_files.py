"""The files of a run say what they are; names of a scene are text in them, no formula and no markup."""

import csv
import html

import pytest
from commands import refused, vtkmuscle_
from faults import files_in
from tiny_scene import HINGE, TOML, write_tiny_scene

import vtkmuscle
from vtkmuscle import Table
from vtkmuscle.data.arrays import field_array, field_string
from vtkmuscle.filters import provenance_of
from vtkmuscle.io import read_polydata

NAME = '=1+1 <script>alert("x")</script> &amp;'


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """What a run says of a scene with an odd name of its coordinate, and its folder."""
    path = write_tiny_scene(tmp_path_factory.mktemp("scene"))
    motion = TOML[TOML.index("[motion]") : TOML.index("[muscles")]
    path.write_text(TOML.replace(motion, HINGE + f"coordinate = '{NAME}'\n\n"))
    out = path.parent / "out"
    done = vtkmuscle_("run", path, "--out", out, "--no-figures")
    return done.stdout, out


def test_a_cell_that_is_no_number_begins_no_formula(run, tmp_path):
    for path in run[1].glob("*.csv"):
        with path.open(newline="") as lines:
            cells = [cell for row in csv.reader(lines) for cell in row]
        assert all(cell[:1] not in ("=", "+", "@") for cell in cells), path
    assert f"'{NAME}" in next(csv.reader([(run[1] / "moment_arms.csv").read_text().splitlines()[1]]))
    table = Table(("name", "@sum", "mm"), [("+1", "a", -2.0), ("-x", "b", 1.0)])
    assert table.to_csv(tmp_path / "t.csv").read_text() == "name,'@sum,mm\n'+1,a,-2.0\n'-x,b,1.0\n"


def test_a_page_shows_a_name_and_no_markup_of_it(run):
    page = (run[1] / "report.html").read_text(encoding="utf-8")
    assert 'alert("x")' not in page
    assert html.escape(NAME, quote=False).partition("alert")[0] in page


def test_files_that_were_not_written_are_not_named(run):
    assert "lengths.csv" in run[0]
    assert "figures" not in run[0]


def test_files_say_what_they_are(run):
    for name in ("spindle", "spindle_fibres", "bones"):
        frame = read_polydata(files_in(run[1] / f"{name}.pvd")[-1])
        assert field_string(frame, "Units") == "mm"
        assert field_string(frame, "Scene") == "tiny"
        assert field_string(frame, "Version") == vtkmuscle.__version__
    muscle = read_polydata(files_in(run[1] / "spindle.pvd")[1])
    steps = {step["filter"]: step["parameters"] for step in provenance_of(muscle)}
    assert {"FixedPointDetector", "BoneMotion", "SliceMorpher", "TautPaths", "PathDeformer"} <= set(steps)
    assert steps["PathDeformer"]["iterations"] == 3
    assert field_array(muscle, "VolumeRatio")[0] == pytest.approx(1.0, abs=1e-9)


def test_what_cannot_be_exported_is_said(run, tmp_path):
    said = refused("export", run[1], tmp_path / "page.gltf")
    assert "unknown format of an export; write .osim" in said
