"""Reading a study: what is wrong is said with file, key and remedy."""

import pytest
from mutations import mutated
from tiny_study import write_tiny_study

from vtkmuscle import InputError
from vtkmuscle.studies.cohort.subjects import Study


@pytest.fixture
def study_file(tmp_path):
    return write_tiny_study(tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('subject = "subjects.csv"\n', "did you mean 'subjects'"),
        ('subjects = "none.csv"\n', "there is no such file"),
        ("groups = 0\n", "groups: must be greater than or equal to 1, not 0"),
        ("groups = 'two'\n", "groups: must be a valid integer, not 'two'; write groups = 3"),
        ("[sensitivity]\nsamples = 1\n", "sensitivity.samples: must be greater than or equal to 3, not 1"),
        ("subjects = \n", "not valid TOML"),
    ],
)
def test_what_is_wrong_in_a_study_is_said(study_file, text, words):
    whole = study_file.read_text()
    kept = "" if text.startswith("subject") else whole
    study_file.write_text(kept + ("" if kept else 'scene = "template.toml"\n') + text)
    with pytest.raises(InputError, match=words) as failure:
        Study.load(study_file)
    assert str(study_file.parent) in str(failure.value)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("", r"column\(s\) id are missing"),
        ("id,folder\n", "no rows; write a line of columns and a line per subject"),
        ("name,folder\na,b\n", r"column\(s\) id are missing"),
        ("id,id\na,b\n", r"column\(s\) id appear twice"),
        ("id,folder\na\n", "line 2 has 1 cells"),
        ("id\na\nA\n", "stands in the table twice"),
        ("id\n../a\n", "cannot be part of a file name"),
    ],
)
def test_what_is_wrong_in_a_table_of_subjects_is_said(study_file, table, words):
    (study_file.parent / "subjects.csv").write_text(table)
    with pytest.raises(InputError, match=words):
        Study.load(study_file)


def test_what_is_wrong_with_a_subject_is_a_problem_of_its_tasks_alone(study_file):
    table = study_file.parent / "subjects.csv"
    table.write_text(table.read_text().replace("ben,ben,long,20", "ben,ben,long,far"))
    problems = {
        case.labels["subject"]: case.problem for cases in Study.load(study_file).cases() for case in cases
    }
    assert "must be a finite number" in problems["ben"]
    assert not problems["anna"]
    study_file.write_text(study_file.read_text() + 'muscles = ["spindel"]\n')
    (first, *_), *_ = Study.load(study_file).cases()
    assert "did you mean 'spindle'" in first.problem


def test_mutated_studies_and_tables_are_read_or_refused_in_words(study_file, pytestconfig, tried):
    kept = {path: path.read_bytes() for path in study_file.parent.glob("*.*")}
    count = 300 if pytestconfig.getoption("--long") else 40
    for seed in range(count):
        path = sorted(kept)[seed % len(kept)]
        path.write_bytes(mutated(kept[path], seed))
        try:
            cases = [case for cases in Study.load(study_file).cases() for case in cases]
        except (ValueError, OSError) as error:
            assert str(error)  # noqa: PT017 -- any other error is a traceback
            tried.add("a study, its table or template, mutated", "refused")
        else:
            assert len({case.name for case in cases}) == len(cases)
            tried.add("a study, its table or template, mutated", "used")
        path.write_bytes(kept[path])
