"""Statistics of a study against known answers."""

import numpy as np

from vtkmuscle.studies.cohort.table import COLUMNS, curves, outliers, spreads

ANGLES = (0.0, 10.0, 20.0)


def measured(rows):
    """Return the curves of rows of (subject, setting, sample, length, moment arm)."""
    common = dict.fromkeys(COLUMNS) | {"motion": "walk", "muscle": "iliacus", "fibre_group": 0}
    common |= {"verdict": "ok", "coordinate": "flexion", "value": np.array(ANGLES)}
    parts = [
        common
        | {"subject": subject, "setting": setting, "sample": sample}
        | {"length_mm": length + np.array(ANGLES), "moment_arm_mm": arm}
        for subject, setting, sample, length, arm in rows
    ]
    return curves(parts)


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
