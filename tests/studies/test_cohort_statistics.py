"""Statistics of a study against known answers."""

import numpy as np
import pytest
from scipy import stats

from vtkmuscle import Table
from vtkmuscle.studies.cohort.schema import Compare, StudyTable
from vtkmuscle.studies.cohort.statistics import compared, outliers, spreads
from vtkmuscle.studies.cohort.subjects import Study
from vtkmuscle.studies.cohort.table import COLUMNS, curves

ANGLES = (0.0, 10.0, 20.0)


def measured(rows):
    """Return the curves of a table with rows of (subject, setting, sample, length, moment arm)."""
    common = dict.fromkeys(COLUMNS) | {"motion": "walk", "muscle": "iliacus", "fibre_group": 0}
    common |= {"verdict": "ok", "coordinate": "flexion", "value": np.array(ANGLES)}
    parts = [
        common
        | {"subject": subject, "setting": setting, "sample": sample}
        | {"length_mm": length + np.array(ANGLES), "moment_arm_mm": arm}
        for subject, setting, sample, length, arm in rows
    ]
    return curves([Table.stacked(COLUMNS, parts)])


def study(tmp_path, names, **more):
    settings = more.pop("settings", {})
    table = StudyTable(subjects="s.csv", scene="t.toml", settings=settings, **more)
    rows = tuple({"id": name, "group": "ab"[i % 2], "person": name[:-1]} for i, name in enumerate(names))
    return Study("study", tmp_path / "study.toml", rows, table)


def test_settings_are_compared_in_pairs(tmp_path, rng):
    first, second = rng.normal(100.0, 5.0, 8), rng.normal(101.0, 5.0, 8)
    names = [f"p{i}" for i in range(8)]
    found = measured(
        [(name, "one", "", a, 1.0) for name, a in zip(names, first, strict=True)]
        + [(name, "two", "", b, 1.0) for name, b in zip(names, second, strict=True)],
    )
    settings = {"one": {}, "two": {}}
    found = compared(study(tmp_path, names, settings=settings, compare=Compare(by="setting")), found)
    lengths = found.where(measure="length_mm", value=10.0)
    expected = stats.ttest_rel(second, first)
    np.testing.assert_allclose(lengths["p_t"], [expected.pvalue])
    np.testing.assert_allclose(lengths["low_95"], [expected.confidence_interval(0.95).low])
    np.testing.assert_allclose(lengths["difference"], [(second - first).mean()])
    np.testing.assert_allclose(lengths["p_rank"], [stats.wilcoxon(second - first).pvalue])
    arms = found.where(measure="moment_arm_mm", value=10.0)
    assert arms["difference"] == [0.0]
    assert np.isnan(arms["p_t"]).all()  # nothing differs, so nothing can be tested


@pytest.mark.parametrize("pair", [None, "person"])
def test_groups_are_compared_as_pairs_or_as_independent_ones(tmp_path, rng, pair):
    names = [f"{person}{side}" for person in range(6) for side in "ab"]
    lengths = rng.normal(100.0, 5.0, 12)
    found = measured([(name, "", "", one, one / 10) for name, one in zip(names, lengths, strict=True)])
    found = compared(study(tmp_path, names, compare=Compare(by="group", pair=pair)), found)
    (p,) = found.where(measure="length_mm", value=0.0)["p_t"]
    first, second = lengths[::2], lengths[1::2]
    test = stats.ttest_rel(second, first) if pair else stats.ttest_ind(second, first, equal_var=False)
    assert p == pytest.approx(test.pvalue)


def test_an_unusual_subject_is_found_and_no_other():
    names = [f"p{i}" for i in range(20)]
    rows = [(name, "", "", 100.0 + 0.1 * (i % 7), 40.0 + 0.1 * (i % 5)) for i, name in enumerate(names)]
    rows[13] = ("p13", "", "", 100.2, 70.0)
    found = outliers(measured(rows))
    assert (*found["subject"], *found["measure"]) == ("p13", "moment_arm_mm")
    assert found["score"] > 100


def test_causes_are_ranked_by_the_spread_of_moment_arms():
    rows = [("p", "", "", 100.0, 40.0)]
    for i, one in enumerate((-1.0, 0.0, 1.0)):
        rows.append(("p", "", f"axis {i + 1}", 100.0, 40.0 + one))
        rows.append(("p", "", f"landmarks {i + 1}", 100.0 + one, 40.0 + 2 * one))
    found = spreads(measured(rows))
    assert found["cause"].tolist() == ["landmarks", "axis"]
    np.testing.assert_allclose(found["sd_moment_arm_mm"], [2.0, 1.0])
    np.testing.assert_allclose(found["sd_length_mm"], [1.0, 0.0])
