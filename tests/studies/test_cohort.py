"""Studies of many subjects: one table, whatever happens on the way."""

import csv
import json
import re
import shutil

import numpy as np
import pytest
from tiny_study import write_tiny_study
from typer.testing import CliRunner

pytest.importorskip("distributed", reason="the extra cohort is not installed")

from faults import small_disk

from vtkmuscle import InputError, Scene
from vtkmuscle.cli import app
from vtkmuscle.data.arrays import points_of, with_points
from vtkmuscle.io import read_polydata, write_polydata
from vtkmuscle.io.parts import Part, Parts
from vtkmuscle.io.writing import locked
from vtkmuscle.run import RunOptions, run_scene
from vtkmuscle.studies import cluster
from vtkmuscle.studies.cohort import COLUMNS, Study, run_study
from vtkmuscle.studies.study import REPORT


@pytest.fixture(scope="module")
def client():
    """A cluster of one thread in this process."""
    import distributed

    with distributed.Client(
        processes=False, n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0"
    ) as found:
        yield found


@pytest.fixture
def study_file(tmp_path):
    return write_tiny_study(tmp_path)


@pytest.fixture(scope="module")
def done(client, tmp_path_factory):
    """A study that is done, its file, its folder and its report."""
    file = write_tiny_study(tmp_path_factory.mktemp("study"))
    out = file.parent / "out"
    return file, out, run_study(Study.load(file), out, client=client)


def tables(out):
    return {name: (out / name).read_bytes() for name in ("cohort.csv", "cohort.html")}


def rows(out):
    with (out / "cohort.csv").open(newline="") as lines:
        return list(csv.DictReader(lines))


def ran(study_file, out, client, **more):
    """Return what became of each task of a run, by subject and muscle."""
    states = {}
    run_study(
        Study.load(study_file),
        out,
        client=client,
        progress=lambda one: states.update({(one.case.labels["subject"], one.case.muscle): one.state}),
        **more,
    )
    return states


def done_of(states):
    return [who for who, state in states.items() if state == "done"]


def test_the_table_has_every_subject_and_failures_as_rows(done):
    _, out, report = done
    found = rows(out)
    assert list(found[0]) == [*COLUMNS, "group", "stop"]
    by = {}
    for row in found:
        by.setdefault((row["subject"], row["muscle"]), []).append(row)
    assert list(by) == [(who, muscle) for who in ("anna", "ben", "carl") for muscle in ("spindle", "other")]
    assert len(by["anna", "spindle"]) == 6
    assert {row["coordinate"] for row in by["anna", "spindle"]} == {"lower_angle"}
    for muscle in ("spindle", "other"):  # one scene, one fault
        (row,) = by["carl", muscle]
        assert (row["verdict"], row["length_mm"]) == ("failed", "")
        assert "spindle.vtp" in row["message"]
    assert report["tasks"] == {"done": 4, "failed": 2}
    assert json.loads((out / REPORT).read_text())["complete"] is True


def test_the_numbers_are_those_of_a_run(done):
    file, out, _ = done
    text = (
        (file.parent / "template.toml").read_text().replace('"{stop:number}"', "20").replace("{folder}/", "")
    )
    (file.parent / "anna/scene.toml").write_text(text)
    scene = Scene.load(file.parent / "anna/scene.toml")
    result = run_scene(scene, None, RunOptions(workers=1, sense=False))
    mine = [row for row in rows(out) if (row["subject"], row["muscle"]) == ("anna", "other")]
    lengths = [float(row["length_mm"]) for row in mine]
    np.testing.assert_allclose(lengths, result.lengths["other"].mean(axis=1), rtol=1e-14)
    (arms,) = result.moment_arms()["other"].values()
    np.testing.assert_allclose([float(row["moment_arm_mm"]) for row in mine], arms.mean, rtol=1e-12)


def test_rows_have_what_is_known_of_the_subject_and_of_errors(done):
    _, out, _ = done
    found = rows(out)
    known = {(row["subject"], row["group"], row["stop"]) for row in found}
    assert known == {("anna", "short", "20.0"), ("ben", "long", "20.0"), ("carl", "short", "20.0")}
    for name in ("length", "moment_arm"):
        assert all(0.0 < float(row[f"{name}_err_mm"]) < 5.0 for row in found if row["subject"] != "carl")


def test_a_message_stands_once_for_each_muscle(done, tmp_path, client):
    file, out, _ = done
    shutil.copytree(out, copy := tmp_path / "out")
    (path,) = (copy / "parts").glob("anna/*/-/-/other.npz")
    name = str(path.relative_to(copy / "parts").with_suffix(""))
    reason = {
        "check": "volume",
        "says": "it swells",
        "do": "look",
        "verdict": "look",
        "value": 2.0,
        "limit": 1.0,
    }
    with np.load(path) as kept:
        key = json.loads(str(kept["facts"]))["key"]
    part = Parts(copy / "parts").read(name)
    facts = {**part.facts, "verdict": "look", "reasons": [reason]}
    Parts(copy / "parts").write(name, key, Part(facts, part.arrays))
    run_study(Study.load(file), copy, client=client)
    mine = [row for row in rows(copy) if (row["subject"], row["muscle"]) == ("anna", "other")]
    assert [row["message"] for row in mine] == ["it swells", *[""] * 5]
    assert {row["flags"] for row in mine} == {"volume"}
    assert "it swells" in (copy / "cohort.html").read_text()


def test_progress_is_written_where_the_output_is_a_file(done, tmp_path, client):
    file, *_ = done
    arguments = "cohort", str(file), "--out", str(tmp_path / "out"), "--scheduler", client.scheduler.address
    ran = CliRunner().invoke(app, arguments)
    assert ran.exit_code == 1, ran.output  # carl's files are damaged
    for who in ("anna, motion, spindle: ok", "ben, motion, other: ok"):
        assert re.search(rf"\d of 6: {who}", ran.output)
    assert re.search(r"carl, motion, spindle: .*spindle.vtp", ran.output)


def test_a_scheduler_that_is_not_there_is_said_within_ten_seconds(study_file, monkeypatch):
    assert cluster.ANSWER < 10.0
    monkeypatch.setattr(cluster, "ANSWER", 0.5)
    with pytest.raises(ConnectionError, match=r"tcp://127\.0\.0\.1:1: no scheduler answers"):
        run_study(Study.load(study_file), study_file.parent / "out", scheduler="tcp://127.0.0.1:1")


def test_the_page_stands_alone_and_shows_every_muscle_and_what_failed(done):
    _, out, _ = done
    page = (out / "cohort.html").read_text()
    assert page.count("<svg") == 2
    assert not re.search(r"""(src|href)=["']http""", page)
    assert "spindle.vtp" in page
    assert page.count("<title>anna</title>") == 4  # two drawings of two muscles
    assert [page.count(f'<th scope="row">{who}</th>') for who in ("anna", "ben", "carl")] == [1, 1, 1]


def test_what_is_finished_is_kept_and_only_what_has_changed_is_done(done, client, tmp_path):
    file, out, _ = done
    before = tables(out)

    def goes_on(**more):
        """Run the study into a copy of its results; return states, and whether the tables are the same."""
        copy = shutil.copytree(out, tmp_path / "out", dirs_exist_ok=True)
        states = ran(file, copy, client, **more)
        return states, tables(copy) == before

    states, same = goes_on()
    assert set(states.values()) == {"kept", "failed"}
    assert same
    template, landmarks = file.parent / "template.toml", file.parent / "ben/attachments/origin.vtp"
    kept = {path: path.read_bytes() for path in (template, landmarks)}
    moved = read_polydata(landmarks)
    write_polydata(landmarks, with_points(moved, points_of(moved) * 0.99))
    assert done_of(goes_on()[0]) == [("ben", "spindle"), ("ben", "other")]
    landmarks.write_bytes(kept[landmarks])
    for word, other in (
        (b"n_fibres = 8", b"n_fibres = 9"),
        (b"[muscles.other]", b"[muscles.other]\ncrosses = []"),
    ):
        template.write_bytes(kept[template].replace(word, other))
        states, same = goes_on()
        assert done_of(states) == [("anna", "other"), ("ben", "other")], other
        assert not same
    template.write_bytes(kept[template])
    states, same = goes_on(fresh=True)
    assert list(states.values()).count("done") == 4
    assert same
    (part,) = (tmp_path / "out/parts").glob("anna/*/-/-/other.npz")
    content = bytearray(part.read_bytes())
    content[len(content) // 2] ^= 1
    part.write_bytes(content)
    states = ran(file, tmp_path / "out", client)
    assert done_of(states) == [("anna", "other")]
    assert tables(tmp_path / "out") == before


def test_settings_samples_and_groups_are_rows_of_their_own(tmp_path, client):
    more = """
muscles = ["spindle"]
groups = 2
[settings.taut]
model = "paths"
[settings.few]
model = "paths"
muscles.spindle.fibres.n_fibres = 4
[sensitivity]
samples = 3
landmarks = 0.5
"""
    people = {"anna": "a", "ben": "b"}
    file = write_tiny_study(tmp_path, more=more, subjects=people)
    for name in people:
        path = tmp_path / name / "muscles/spindle.vtp"
        surface = read_polydata(path)
        scale = {"anna": 1.0, "ben": 1.05}[name]
        write_polydata(path, with_points(surface, points_of(surface) * (scale, 1.0, 1.0)))
    out = tmp_path / "out"
    run_study(Study.load(file), out, client=client)
    found = rows(out)
    assert {row["setting"] for row in found} == {"taut", "few"}
    assert {row["sample"] for row in found} == {"", *(f"landmarks {n}" for n in (1, 2, 3))}
    assert {row["fibre_group"] for row in found} == {"0", "1"}
    for setting, count in (("taut", 6), ("few", 4)):
        fibres = {row["fibre_group"]: int(row["fibres"]) for row in found if row["setting"] == setting}
        assert sum(fibres.values()) == count
    with (out / "sensitivity.csv").open(newline="") as lines:
        spreads = list(csv.DictReader(lines))
    assert {row["cause"] for row in spreads} == {"landmarks"}
    assert all(float(row["sd_length_mm"]) > 0.0 for row in spreads)


def test_a_second_run_into_the_folder_and_another_study_are_refused(done, study_file, client):
    file, out, _ = done
    with locked(out), pytest.raises(BlockingIOError, match="another run is writing to it"):
        run_study(Study.load(file), out, client=client)
    with pytest.raises(InputError, match="another study"):
        run_study(Study.load(study_file), out, client=client)
    mine = study_file.parent / "cohort.csv"
    mine.write_text("mine")
    with pytest.raises(InputError, match="no study has made"):
        run_study(Study.load(study_file), study_file.parent, client=client)
    assert mine.read_text() == "mine"


def test_results_are_not_written_through_links(study_file, tmp_path, client):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "out/parts").mkdir(parents=True)
    (tmp_path / "out" / REPORT).write_text(json.dumps({"study_file": str(study_file.absolute())}))
    (tmp_path / "out/parts/anna").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(NotADirectoryError, match=r"anna is a link to .*not written through links"):
        run_study(Study.load(study_file), tmp_path / "out", client=client)
    assert not list((tmp_path / "elsewhere").iterdir())


def test_a_full_disk_is_one_error_and_what_is_finished_stays(done, tmp_path, client, tried):
    file, _, _ = done
    with small_disk(tmp_path / "disk", 96) as disk:
        with pytest.raises(OSError, match="No space left on device"):
            run_study(Study.load(file), disk / "out", client=client)
        tried.add("a cohort on a disk that runs full", "refused")
        assert not list(disk.rglob(".*.partial"))
        assert json.loads((disk / "out" / REPORT).read_text())["complete"] is False


def test_a_folder_that_vanishes_is_one_error_and_the_same_command_mends_it(study_file, done, client, tried):
    out = study_file.parent / "out"

    def vanish(one):
        if one.done == 3:
            shutil.rmtree(out / "parts")

    with pytest.raises(FileNotFoundError, match="removed or damaged while the study ran"):
        run_study(Study.load(study_file), out, client=client, progress=vanish)
    tried.add("a cohort whose folder vanishes", "refused")
    run_study(Study.load(study_file), out, client=client)
    assert (out / "cohort.csv").read_bytes().replace(str(study_file.parent).encode(), b"") == (
        done[1] / "cohort.csv"
    ).read_bytes().replace(str(done[0].parent).encode(), b"")


def test_a_cache_that_cannot_be_used_changes_no_number(done, study_file, client, monkeypatch, tried):
    unusable = study_file.parent / "cache"
    unusable.write_text("a file")
    monkeypatch.setenv("VTKMUSCLE_CACHE", str(unusable))
    out = study_file.parent / "out"
    ran(study_file, out, client)
    tried.add("a cohort with a cache that cannot be used", "used")

    def numbers(folder):
        return [row["length_mm"] for row in rows(folder)]

    assert numbers(out) == numbers(done[1])


def test_another_version_on_a_worker_is_one_error(study_file, client, monkeypatch):
    monkeypatch.setattr("vtkmuscle.studies.cluster.code_digest", lambda: "another")
    with pytest.raises(OSError, match="another version of vtkmuscle"):
        run_study(Study.load(study_file), study_file.parent / "out", client=client)


def test_a_scene_of_its_own_per_subject(tmp_path, client):
    file = write_tiny_study(tmp_path, subjects={"anna": "a"})
    text = (tmp_path / "template.toml").read_text().replace("{folder}/", "")
    (tmp_path / "anna/scene.toml").write_text(text)
    file.write_text('subjects = "subjects.csv"\nscene = "{folder}/scene.toml"\nmuscles = ["other"]\n')
    run_study(Study.load(file), tmp_path / "out", client=client)
    assert {(row["muscle"], row["verdict"]) for row in rows(tmp_path / "out")} == {("other", "ok")}
