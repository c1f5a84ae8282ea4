"""Paths of too few segments: right, or seen by the verdict."""

from dataclasses import replace
from unittest.mock import patch

import numpy as np
import phantoms
import pytest
from phantoms import pulleys
from slow import slow

from vtkmuscle import Scene
from vtkmuscle.phantoms.implicit import ball
from vtkmuscle.run.verdict import reasons_of

GROUP = "Few segments of a path round bones"

#: An error of the mean length that must be seen [mm]: of arms the check's limit is as much.
WRONG = 2.0

#: Phantoms over rollers, edges and grooves.
CASES = {
    "two rollers": lambda: phantoms.strap_over_two_joints(
        coordinates=np.column_stack([np.zeros(9), np.linspace(0.0, 90.0, 9)])
    ),
    "two cylinders": phantoms.slivered_tendon,
    "between bones": phantoms.tendon_between_bones,
    "along a bone": phantoms.strap_along_bone,
    "a sharp brim": phantoms.flexor_over_brim,
}
QUICK = "a sharp brim"


@pytest.mark.parametrize("case", [*slow(*[case for case in CASES if case != QUICK]), QUICK])
def test_too_few_segments_are_seen(case, ledger):
    scene = Scene.from_phantom(CASES[case](), n_fibres=9)
    scene = replace(scene, deformer="none", motion=scene.motion.part(range(0, len(scene.motion.times), 2)))
    (name,) = scene.muscles
    runs = {
        n: replace(scene, paths={"resolution": n}).run(report=False, figures=False, sense=False)
        for n in (8, 12, 16, 24, 64)
    }
    limit = runs.pop(64).lengths[name].mean(axis=1)
    for n, run in runs.items():
        off = np.nanmax(np.abs(run.lengths[name].mean(axis=1) - limit))
        reasons = reasons_of(run.report["muscles"][name]["verdict"])
        seen = [reason for reason in reasons if reason.check == "coarse"]
        assert seen or off < WRONG
        assert n > 8 or seen[0].verdict == "failed"
        assert n < 24 or not seen or seen[0].verdict == "look"
        if seen:
            ledger.refused(GROUP, f"{case}, {n} segments", f"{seen[0].verdict}: {seen[0].says}")
        else:
            ledger.passed(GROUP, f"{case}, {n} segments", "error of length [mm]", off)


@pytest.mark.parametrize("n", [12, 16])
def test_a_cord_of_few_segments_stays_on_a_ball(n):
    """Its middle runs round 24 mm; with less tissue beside them, paths slipped off and were 60 mm shorter."""
    with patch.object(pulleys, "rod", lambda _start, _end, radius: ball((0.0, 0.0, 0.0), radius)):
        scene = Scene.from_phantom(pulleys.cord_over_roller([4.0] * 3, 24.0), n_fibres=9)
    run = replace(scene, deformer="none", paths={"resolution": n}).run(figures=False, sense=False)
    (lengths,) = (each.mean(axis=1) for each in run.lengths.values())
    wound = 24.0 * np.radians(np.subtract(run.times, run.times[0]))
    np.testing.assert_allclose(lengths - lengths[0], wound, atol=4.0)
