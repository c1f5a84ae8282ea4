"""The page of a run, as text."""

import copy
import html
import re

import numpy as np
import pytest
from commands import refused, vtkmuscle_

from vtkmuscle import Result
from vtkmuscle.report import page_of
from vtkmuscle.report.data import Pack, curves_of

#: Whatever a browser would load: in attributes of HTML, or in a style.
LOADS = re.compile(r"""(?:src|href|action)\s*=\s*["']?(?!#|data:)[^"'\s>]+|url\(|@import""")


def words_of(page):
    """Return what a page says, without its programs, styles and data."""
    bare = re.sub(r"<(script|style).*?</\1>", "", page, flags=re.DOTALL)
    return html.unescape(re.sub(r"<[^>]+>", " ", bare))


@pytest.fixture(scope="module")
def page(run_folder):
    return (run_folder[0] / "report.html").read_text(encoding="utf-8")


def changed(result):
    """Return a result whose report can be changed."""
    other = copy.copy(result)
    other.report = copy.deepcopy(dict(result.report))
    return other


def test_a_run_writes_its_page_and_a_result_read_back_writes_the_same(run_folder, tmp_path):
    out, result = run_folder
    again = Result.load(out).write_report(tmp_path / "again.html")
    # The time that the page itself took is known after it is written.
    now = result.write_report(tmp_path / "now.html")
    assert again.read_text(encoding="utf-8") == now.read_text(encoding="utf-8")


def test_the_command_writes_it_again(run_folder, tmp_path):
    out, _ = run_folder
    vtkmuscle_("report", out, "--out", tmp_path / "new.html")
    assert (tmp_path / "new.html").stat().st_size > 1e5
    refused("report", tmp_path)


def test_nothing_is_loaded_from_anywhere(page):
    assert LOADS.findall(re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)) == []
    assert not re.search(r"<script[^>]+src", page)
    assert "default-src 'none'" in page, "what a browser goes by, whatever its programs do"
    assert len(page) < 15e6


def test_it_says_what_was_found(run_folder, page):
    _, result = run_folder
    words = words_of(page)
    for name in ("spindle", "second one"):
        assert name in words
    for muscle in result.report["muscles"].values():
        for reason in muscle["verdict"]["reasons"]:
            assert reason["says"][1:] in words
            assert reason["do"][1:] in words
    for digest in result.report["sha256"].values():
        assert digest in words
    assert result.report["versions"]["vtk"] in words
    swatches = re.findall(r'class="swatch" style="background: (.*?)"', page)
    assert len(set(swatches)) == len(result.report["muscles"]), "each muscle has its colour"


def test_pennation_is_that_of_the_cross_section(run_folder, page):
    """As in architecture.csv, not the angle of whole fibres to the surface."""
    head = [title.strip() for title in re.findall(r"<th[^>]*>([^<]*)", page)]
    at = head.index("pennation, origin [deg]") - head.index("volume [cm³]")
    name, muscle = next(iter(run_folder[1].items()))
    row = re.search(rf"<tr>\s*<th[^>]*>{name}.*?</tr>", page, re.DOTALL)[0]
    cells = re.findall(r"<td[^>]*>([^<]*)", row)
    mean = muscle.architecture["fascicle_pennation_origin_deg"]["mean"]
    assert float(cells[at + 1]) == pytest.approx(mean, rel=5e-3), cells


def test_of_many_muscles_a_line_is_shown_and_the_numbers_on_demand(run_folder):
    def summaries(page):
        cards = re.findall(r'<article class="verdict.*?</article>', page, flags=re.DOTALL)
        return [re.findall(r"<summary>(mean length, bone to bone [^<]*)</summary>", card) for card in cards]

    _, result = run_folder
    assert summaries(page_of(result)) == [[], []]
    few = words_of(page_of(result))
    many = page_of(result, many=1)
    assert [len(found) for found in summaries(many)] == [1, 1]
    assert set(few.split()) == set(words_of(many).split()), "nothing is lost"


def test_errors_of_means_are_a_table_and_bands(run_folder):
    other = changed(run_folder[1])
    sizes = dict.fromkeys(("total_mm", "model_mm", "sampling_mm", "numerical_mm", "bow_mm"), 0.125)
    other.report["muscles"]["spindle"]["errors"] = sizes | {"total_mm": None}
    words = " ".join(words_of(page_of(other)).split())
    assert "numerical bow spindle change of length \u2013 0.12 0.12 0.12 0.12" in words
    other.times = [1.7e6 + 0.01 * frame for frame in other.frames]
    curves = curves_of(other, Pack())
    assert curves["times"] == other.times
    low, high = np.array(curves["muscles"][0]["lengths"]["held"])
    assert high - low == pytest.approx(2.0 * other._tracks["spindle"].errors()["total"], abs=0.03)


def test_a_muscle_that_failed_on_the_way_shows_the_frames_it_has(run_folder):
    _, result = run_folder
    track = copy.copy(result._tracks["spindle"])
    track.report = {**track.report, "frames": track.report["frames"][:2]}
    track.surfaces, track.fibres, track.lengths = track.surfaces[:2], track.fibres[:2], track.lengths[:2]
    track.segment_errors, track.bows = track.segment_errors[:2], track.bows[:2]
    report = copy.deepcopy(dict(result.report))
    report["muscles"]["spindle"]["frames"] = report["muscles"]["spindle"]["frames"][:2]
    other = Result(result.rest_bones(), result.motion, {**result._tracks, "spindle": track}, report)
    assert "frames 2 of 5" in " ".join(words_of(page_of(other)).split())


@pytest.mark.parametrize("case", ["no deformer", "no fibres", "no coordinate"])
def test_scenes_without_surfaces_fibres_or_coordinates_have_a_page(case, two_muscles):
    from dataclasses import replace

    scene = two_muscles
    if case == "no deformer":
        scene = replace(scene, deformer="none", solver={})
    if case == "no fibres":
        scene = replace(scene, muscles={n: replace(m, fibres=None) for n, m in scene.muscles.items()})
    if case == "no coordinate":
        scene = replace(scene, motion=replace(scene.motion, coordinates={}))
    page = page_of(scene.run(frames="0:4"))
    assert ('id="show-surfaces"' in page) == (case != "no deformer")
    assert ('id="lengths"' in page) == (case != "no fibres")
    assert ('id="arms"' in page) == (case == "no deformer")


def test_a_page_ends_in_html(run_folder, tmp_path):
    with pytest.raises(ValueError, match=r"in \.html"):
        run_folder[1].write_report(tmp_path / "report.json")


def test_numbers_are_short_and_plain():
    from vtkmuscle.report.page import number

    found = [number(value) for value in (0.0, 1.0, -12.345, 1234.5, 0.00012, None, np.nan, 99.97, 1e-9)]
    texts = "0", "1.00", "\u221212.3", "1\u202f234", "1.2e\u221204", "\u2013", "\u2013", "100.0", "0"
    assert found == [*texts]
