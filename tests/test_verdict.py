"""A planted fault of each kind is found, in its frame, and a good muscle is ok."""

import json
from dataclasses import replace

import numpy as np
import pytest
from commands import vtkmuscle_
from shapes import HalfSpace
from tiny_scene import ellipsoid, write_tiny_scene

from vtkmuscle import Scene, hinge
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.measures import MODEL, SHORTENED
from vtkmuscle.core.mesh.surface import unique_edges
from vtkmuscle.core.moment_arms.levers import distances_moved, even_stretches, largest_turns, length_jumps
from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.data.arrays import add_arrays, points_of, triangles_of, with_points
from vtkmuscle.data.attachments import Aponeurosis
from vtkmuscle.filters import PathDeformer
from vtkmuscle.phantoms import spindle_over_hinge, wrapping_cylinder
from vtkmuscle.phantoms.one_hinge import INSERTION, ORIGIN, circle
from vtkmuscle.run.frames import MuscleTrack
from vtkmuscle.run.measure import MuscleMeasure
from vtkmuscle.run.report_values import DEFINITIONS
from vtkmuscle.run.verdict import CHECKS, FULL_SIZE, judge, reasons_of

#: What a good frame has.
GOOD = {
    "volume_ratio": 1.0 + 1e-12,
    "fixed_error_max_mm": 1e-13,
    "misshapen_area": 0.004,
    "dihedral_error_p95_deg": 15.0,
    "folded_edges": 1,
    "penetration_new_max_mm": 0.1,
    "penetration_new_p95_mm": 0.0,
    "squeezed_p95_mm": 0.0,
    "sag_p95_mm": 0.5,
    "hooked_paths": 0.0,
    "passed_paths": 0.0,
    "lengthening_error": 0.02,
    "unsettled": 0,
    "fibres_outside_max_mm": 0.1,
    "fibres_penetration_new_max_mm": 0.1,
}
FRAMES = 20
TIMES = np.arange(FRAMES) * 2.0
MOTION = hinge("b", (0, 0, 0), (1, 0, 0), TIMES)


def rows(**changed):
    """Return the rows of good frames; a number in place of a figure is that of frame 13."""
    table = [{"frame": i, "time": float(TIMES[i]), **GOOD} for i in range(FRAMES)]
    for name, value in changed.items():
        table[13][name] = value
    return table


def lengths(at=None, change=0.0, count=1):
    """Return the lengths of a hundred fibres over the frames, some of them changed from a frame on."""
    found = 120.0 + 0.1 * np.arange(100.0) + 20.0 * np.sin(np.radians(TIMES))[:, None]
    if at is not None:
        found[at:, 3 : 3 + count] += change
    return found


#: Fibres at rest that are well.
AT_REST = {"crossing_share": 0.1, "hooked_share": 0.0, "turning_p95_deg": 150.0, "bare_share": 0.02}


def verdict(table=None, **given):
    fibres = {"lengths": lengths(), "rest_lengths": lengths()[0], "at_rest": AT_REST}
    fibres |= {name: given.pop(name) for name in [*given] if name in fibres}
    of_fibres = [] if fibres["lengths"] is None else list(fibres["lengths"])
    report = {"frames": table or rows(), "fibres": fibres["at_rest"] or {}}
    track = MuscleTrack(lengths=of_fibres, fibre_lengths=of_fibres, report=report)
    return judge(track, fibres["rest_lengths"], **{"motion": MOTION, "n_edges": 1000, **given})


def test_a_good_muscle_is_ok_and_all_was_checked():
    assert verdict() == {"verdict": "ok", "reasons": [], "not_checked": {}}


def test_paths_that_do_not_come_to_rest_are_told_by_their_frames():
    """One frame of 20 needs a look, two fail; all frames are unsettled where the rest pose is."""
    assert verdict(rows())["verdict"] == "ok"
    for frames, expected, says in (([7], "look", "in 5 %"), ([7, 13], "failed", "in 10 %")):
        table = rows()
        for frame in frames:
            table[frame]["unsettled"] = 1
        (reason,) = verdict(table)["reasons"]
        assert (reason["check"], reason["verdict"], reason["frame"]) == ("unsettled", expected, 7)
        assert says in reason["says"]
    table = [{**row, "unsettled": 1} for row in rows()]
    (reason,) = verdict(table)["reasons"]
    assert (reason["verdict"], reason["frame"]) == ("failed", 0)
    assert "in 100 %" in reason["says"]


@pytest.mark.parametrize(
    ("check", "column", "look", "failed"),
    [
        ("volume", "volume_ratio", 0.98, 1.06),
        ("fixed points", "fixed_error_max_mm", 0.02, 2.0),
        ("misshapen", "misshapen_area", 0.08, 0.4),
        ("crumpled", "dihedral_error_p95_deg", 36.0, 55.0),
        ("folded", "folded_edges", 8, 40),
        ("penetration", "penetration_new_max_mm", 1.0, 8.0),
        ("squeezed", "squeezed_p95_mm", 0.5, 6.0),
        ("coarse", "sag_p95_mm", 3.0, 6.0),
        ("hooked paths", "hooked_paths", 0.1, 0.6),
        ("passed paths", "passed_paths", 0.05, 0.2),
        ("fibres and paths", "lengthening_error", 0.06, 0.3),
        ("widespread penetration", "penetration_new_p95_mm", 0.2, 1.5),
        ("fibres outside", "fibres_outside_max_mm", 7.0, 16.0),
        ("fibres in bone", "fibres_penetration_new_max_mm", 7.0, 16.0),
    ],
)
def test_a_planted_fault_is_told_with_its_frame(check, column, look, failed):
    for value, expected in ((look, "look"), (failed, "failed"), (np.inf, "failed")):
        found = verdict(rows(**{column: value}))
        assert found["verdict"] == expected
        (reason,) = reasons_of(found)
        assert (reason.check, reason.verdict, reason.frame, reason.time) == (check, expected, 13, 26.0)
        assert reason.do
        assert "frame 13" in str(reason)
        assert np.isfinite(reason.value)
        json.dumps(found, allow_nan=False)


@pytest.mark.parametrize(("kind", "look", "failed"), [("long", 1.7, 2.6), ("short", 0.45, 0.3)])
def test_fibres_that_no_muscle_has_are_told(kind, look, failed):
    for ratio, expected in ((look, "look"), (failed, "failed")):
        (reason,) = reasons_of(verdict(lengths=np.linspace(1.0, ratio, FRAMES)[:, None] * lengths()[0]))
        assert (reason.check, reason.verdict, reason.frame) == (f"{kind} fibres", expected, FRAMES - 1)


@pytest.mark.parametrize(
    ("change", "count", "expected", "checks"),
    [
        (0.5, 50, "ok", set()),
        (2.5, 1, "look", {"jumps"}),
        (18.0, 1, "look", {"jumps"}),
        (18.0, 10, "failed", {"jumps", "widespread jumps"}),
        (120.0, 1, "failed", {"jumps"}),
    ],
)
@pytest.mark.parametrize("at", [1, 9, FRAMES - 1])
def test_a_length_that_jumps_is_told(change, count, expected, checks, at):
    found = verdict(lengths=lengths(at, change, count))
    assert found["verdict"] == expected
    assert {(r.check, r.frame) for r in reasons_of(found)} == {(check, at) for check in checks}


def test_where_there_are_no_fibres_that_is_told():
    bare = verdict(lengths=None, rest_lengths=None, at_rest=None)
    assert bare["verdict"] == "ok"
    assert bare["not_checked"] == dict.fromkeys(
        (
            *("long fibres", "short fibres", "jumps", "widespread jumps"),
            *("crossed fibres", "hooked fibres", "winding fibres", "bare"),
        ),
        "the muscle has no fibres",
    )


@pytest.mark.parametrize(
    ("check", "key", "look", "failed"),
    [
        ("crossed fibres", "crossing_share", 0.4, 0.9),
        ("hooked fibres", "hooked_share", 0.2, 0.6),
        ("winding fibres", "turning_p95_deg", 300.0, 600.0),
        ("bare", "bare_share", 0.2, 0.6),
    ],
)
def test_fibres_that_lie_badly_at_rest_are_not_ok(check, key, look, failed):
    for value, expected in ((look, "look"), (failed, "failed")):
        found = verdict(at_rest={**AT_REST, key: value})
        (reason,) = reasons_of(found)
        assert (found["verdict"], reason.check, reason.frame) == (expected, check, 0)
        assert "at rest" in reason.says


def test_what_has_no_figure_is_not_judged_and_told():
    table = rows()
    for row in table:
        row["penetration_new_max_mm"] = row["penetration_new_p95_mm"] = None
        del row["volume_ratio"]
    found = verdict(table)
    assert found["verdict"] == "ok"
    assert found["not_checked"] == {
        "penetration": "no bone has an inside",
        "widespread penetration": "no bone has an inside",
        "volume": "not measured",
    }
    few = verdict(rows()[:4], lengths=lengths()[:4], motion=None)  # too few for a jump among steps
    assert few["not_checked"].keys() == {"jumps", "widespread jumps"}


def test_what_could_not_be_computed_failed_also_in_the_first_frame_kept():
    for count in (5, 0):
        failure = (5, 10.0, InputError("", "out of range", "use less force"))
        report = {"frames": rows()[:count]}
        track = MuscleTrack(fibre_lengths=list(lengths()[:count]), report=report, failure=failure)
        found = judge(track, lengths()[0], n_edges=1000)
        (reason,) = reasons_of(found)
        assert (found["verdict"], reason.frame, reason.do) == ("failed", 5, "use less force")
        assert "out of range" in reason.says


def test_the_worst_reason_comes_first_and_decides():
    found = verdict(rows(volume_ratio=1.02, misshapen_area=0.4, folded_edges=8))
    assert found["verdict"] == "failed"
    assert [reason.check for reason in reasons_of(found)] == ["misshapen", "volume", "folded"]


def test_limits_that_are_lengths_are_less_for_a_small_muscle():
    table = rows(penetration_new_max_mm=0.3)
    assert verdict(table, size=FULL_SIZE)["verdict"] == "ok"
    assert verdict(table, size=0.1 * FULL_SIZE)["verdict"] == "look"


def test_the_limits_are_those_of_the_documentation(request):
    section = (request.config.rootpath / "docs/reference/verdicts.rst").read_text()
    for name, check in CHECKS.items():
        row = section[section.index(f"* - {name}\n") :].split("   * - ")[0]
        cells = [cell.strip() for cell in row.split("     - ")[-2:]]
        assert [float(cell.split()[0]) for cell in cells] == pytest.approx(
            [check.look, check.failed], rel=0.01
        ), name
    assert {"verdict", "pennation_origin_deg", "fascicle_pennation_origin_deg"} <= {*DEFINITIONS}
    assert f"model_mm: {MODEL} (1 + {SHORTENED:g} s)" in DEFINITIONS["errors"]


@pytest.mark.parametrize("sheets", [(), (0.3, 0.7)])
@pytest.mark.parametrize(("deformer", "frames"), [("paths", None), ("pbd", None), ("pbd", 20)])
def test_fibres_that_lengthen_otherwise_than_their_paths_are_told(deformer, frames, sheets):
    """A spindle that bows aside; with sheets its fibres are between tendons, which do not lengthen."""
    solver = {"prediction": "velocity"} if deformer == "pbd" else {}  # in which the spindle bows
    scene = replace(Scene.from_phantom(spindle_over_hinge(), n_fibres=8), deformer=deformer, solver=solver)
    fan = np.column_stack([np.zeros(10, int), np.arange(1, 11), np.arange(2, 12)])
    aponeuroses = [
        Aponeurosis(side, INSERTION + part * (ORIGIN - INSERTION) + circle(4.0), fan)
        for side, part in zip(("distal", "proximal"), sheets, strict=False)
    ]
    muscle = replace(scene.muscles["spindle"], aponeuroses=tuple(aponeuroses))
    result = replace(scene, muscles={"spindle": muscle}).run(frames=frames, figures=False, report=False)
    reasons = reasons_of(result.report["muscles"]["spindle"]["verdict"])
    assert [why.frame for why in reasons if why.check == "fibres and paths"] == [20] * (deformer == "pbd")


def test_the_depth_of_chords_in_a_bone_is_no_difference_of_arm_and_slope():
    """A strap round a cylinder, and a coordinate that moves nothing: its arms and their errors are 0."""
    scene = Scene.from_phantom(wrapping_cylinder(angles=[0.0, 10.0, 20.0]), n_fibres=8)
    held = {"held": Coordinate([0.0] * 3, twists={"pulley": np.zeros((3, 6))})}
    motion = replace(scene.motion, coordinates=scene.motion.coordinates | held)
    verdict = replace(scene, motion=motion, deformer="none").run().report["muscles"]["strap"]["verdict"]
    assert [why.check for why in reasons_of(verdict)] == []


# ------------------------------------------------------------------------------- jumps


def test_a_sweep_that_turns_back_is_no_jump():
    angles = np.concatenate([np.arange(0.0, -31.0, -5.0), np.arange(-25.0, 61.0, 5.0)])
    motion = hinge("b", (0, 0, 0), (1, 0, 0), np.arange(len(angles)))
    table = np.array([hinge("b", (0, 0, 0), (1, 0, 0), [a]).transforms["b"][0] for a in angles])
    motion = RigidMotion(motion.times, {"b": table})
    curve = (120.0 + 40.0 * np.radians(angles))[:, None]
    stretches = even_stretches(motion)
    assert stretches[:6].max() == 0
    assert stretches[6:].min() == 1
    assert length_jumps(curve, motion.times).max() > 1.0
    assert length_jumps(curve, motion.times, stretches).max() < 1e-9


def test_uneven_rows_of_a_table_are_no_jump():
    angles = np.array([0.0, 4, 8, 16, 20, 24, 30, 38, 42, 50, 54, 60])
    motion = replace(hinge("b", (0, 90, 0), (1, 0, 0), angles), times=np.arange(12.0))
    curve, moved = (120.0 + 40.0 * np.sin(np.radians(angles)))[:, None], distances_moved(motion)
    jumps = [length_jumps(curve, at, even_stretches(motion)).max() for at in (motion.times, moved)]
    assert not even_stretches(motion).any()  # steps that halve or double
    odd_times = np.cumsum([0.0, 1, 9, 1, 7, 2, 30, 0.1, 4, 50, 3, 8])
    assert not even_stretches(replace(motion, times=odd_times)).any()
    assert 20.0 * jumps[1] < 0.8 < jumps[0]
    curve[6:] += 4.0
    assert int(length_jumps(curve, moved, even_stretches(motion)).argmax()) == 5


@pytest.mark.parametrize("size", [1 / 30, 1.0, 30.0])
def test_rounding_cuts_no_even_sweep_and_hides_no_jump(size):
    """50 hinges anywhere, and a muscle of 200 mm whose length jumps by 7 mm."""
    rng = np.random.default_rng(50)
    for _ in range(50):
        count, step = int(rng.integers(6, 40)), rng.uniform(1.0, 9.0)
        centre, axis = size * rng.normal(0.0, 300.0, 3), rng.normal(size=3)
        motion = hinge("b", centre, axis, step * np.arange(count))
        stretches, turns = even_stretches(motion), largest_turns(motion)
        assert not stretches.any()
        curve = size * (200.0 + 40.0 * np.sin(np.radians(motion.times)))[:, None]
        assert length_jumps(curve, motion.times, stretches, turns).max() < 0.02 * size
        curve[count // 2 :] += 7.0 * size * np.sign(curve[-1] - curve[0])
        jumps = length_jumps(curve, motion.times, stretches, turns)
        assert int(jumps.argmax()) == count // 2 - 1
        assert jumps.max() > 1.0 * size


# ------------------------------------------------------------------------------- what is measured


def ball(height=40, n=24):
    surface = ellipsoid((20, 20, height), (0, 0, 0), n)
    add_arrays(surface, points={"FixedTo": np.full(surface.GetNumberOfPoints(), -1, dtype=np.int32)})
    return surface


def measured(points, distances=None):
    measure = MuscleMeasure(ball(), ["bone"], distances or {}, 1.0)
    return measure.frame(points, {}), measure


def test_an_edge_that_folds_back_counts_and_one_that_was_folded_does_not():
    points = points_of(ball())
    row, measure = measured(points)
    assert row["folded_edges"] == 0
    assert measure.n_edges == len(unique_edges(triangles_of(ball(), "ball")))
    side = int(points[:, 0].argmax())
    points[side, 1] += 12.0  # slides over its neighbours: the triangles between lie on theirs
    assert measured(points)[0]["folded_edges"] >= 2
    measure = MuscleMeasure(with_points(ball(), points), ["bone"], {}, 1.0)
    assert measure.frame(points, {})["folded_edges"] == 0


def test_the_share_of_a_surface_that_is_out_of_shape_is_by_its_area():
    """A ball: where its normal n is (n_x^2 + 16 (1 - n_x^2))^(1/2) is how much it is stretched."""
    points = points_of(ball(20, 60))
    measure = MuscleMeasure(ball(20, 60), ["bone"], {}, 1.0)
    for factor, share in ((1.0, 0.0), (2.3, 0.0), (4.0, 0.826), (0.4, 0.0), (0.1, 0.321)):
        now = points * [factor, 1.0, 1.0]
        assert measure.frame(now, {})["misshapen_area"] == pytest.approx(share, abs=0.03)


def test_what_was_in_a_bone_at_rest_is_not_new():
    rest = points_of(ball())
    same, measure = measured(rest, {"bone": HalfSpace(12.0)})
    assert measure.at_rest()["rest"]["penetration_max_mm"] == pytest.approx(8.0, abs=0.3)
    assert same["penetration_max_mm"] == pytest.approx(8.0, abs=0.3)
    assert (same["penetration_new_max_mm"], same["penetration_new_p95_mm"]) == (0.0, 0.0)
    measure = MuscleMeasure(ball(), ["bone"], {"bone": HalfSpace(12.0)}, 1.0)
    deeper = measure.frame(rest + np.array([0.75, 0.0, 0.0]), {})
    assert deeper["penetration_new_max_mm"] == pytest.approx(0.75)


def test_fibres_that_leave_the_muscle_or_enter_a_bone_are_measured():
    measure = MuscleMeasure(ball(), ["bone"], {"bone": HalfSpace(3.0)}, 10.0)
    lines, offsets = (
        np.array([[0.0, 0, -30], [5, 0, 0], [0, 0, 30], [0, 0, -30], [0, 0, 30]]),
        np.array([0, 3, 5]),
    )
    measure.take_fibres_at_rest(lines, offsets)
    still = measure.fibres(lines, offsets, points_of(ball()), measure.depths(lines, {}))
    assert set(still.values()) == {0.0}
    moved = lines.copy()
    moved[1, 0], moved[4] = 6.5, [0.0, 0.0, 42.0]
    found = measure.fibres(moved, offsets, points_of(ball()), measure.depths(moved, {}))
    assert found["fibres_penetration_new_max_mm"] == pytest.approx(15.0)
    assert found["fibres_outside_max_mm"] == pytest.approx(20.0, rel=0.02)
    bent = points_of(ball()) + points_of(ball())[:, 2:] ** 2 / 40.0 * [1.0, 0.0, 0.0]
    chord = np.array([[22.5, 0.0, -30.0], [22.5, 0.0, 30.0]])
    nowhere = MuscleMeasure(ball(), ["bone"], {}, 1.0).fibres(chord, np.array([0, 2]), bent, None)
    assert nowhere["fibres_penetration_new_max_mm"] is None
    assert nowhere["fibres_outside_max_mm"] == 0.0
    assert nowhere["fibres_outside_between_max_mm"] == pytest.approx(2.5, abs=0.2)


# ------------------------------------------------------------------------------- runs


@pytest.fixture
def scene_file(tmp_path):
    path = write_tiny_scene(tmp_path / "scene")
    text = path.read_text()
    start, end = text.index("[muscles.spindle]"), text.index("[solver]")
    other = text[start:end].replace("spindle]", "other]")
    path.write_text(text[:end] + other + text[end:].replace("iterations = 3", "iterations = 30"))
    return path


def going_astray(monkeypatch, *, at):
    """Let the first muscle's solve fail at a time."""
    whole, chosen = PathDeformer.execute, []

    def execute(self, *inputs):
        chosen.append(self) if not chosen else None
        if self is chosen[0] and self.request_time == at:
            raise ValueError("the muscle left the range of numbers; use a smaller force")
        return whole(self, *inputs)

    monkeypatch.setattr(PathDeformer, "execute", execute)


def run(path, out, *options, status=0):
    return vtkmuscle_("run", path, "--out", out, "--workers", "1", *options, status=status)


def test_a_good_run_is_ok_and_says_so(scene_file, tmp_path):
    done = run(scene_file, tmp_path / "out", "--no-figures")
    report = json.loads((tmp_path / "out/report.json").read_text())
    for name in ("spindle", "other"):
        assert report["muscles"][name]["verdict"]["verdict"] == "ok"
        line = next(line for line in done.stdout.splitlines() if line.startswith(f"{name}: "))
        assert line.endswith(": ok")
        assert "deeper in a bone than at rest" in line


def test_a_failed_muscle_is_exit_status_1_and_the_others_are_written(scene_file, tmp_path, monkeypatch):
    going_astray(monkeypatch, at=15.0)
    out = tmp_path / "out"
    done = run(scene_file, out, "--quiet", "--no-figures", status=1)
    assert done.stdout == ""
    assert "error: spindle: failed, frame 3 (time 15): the frame could not be computed" in done.stderr
    assert "use a smaller force" in done.stderr
    report = json.loads((out / "report.json").read_text())
    assert report["complete"] is True
    assert report["muscles"]["spindle"]["verdict"]["verdict"] == "failed"
    assert report["muscles"]["other"]["verdict"]["verdict"] == "ok"
    assert [len(report["muscles"][name]["frames"]) for name in ("spindle", "other")] == [3, 5]
    assert len(list((out / "other").iterdir())) == 5
    assert len(list((out / "spindle").iterdir())) == 3
    assert len((out / "lengths.csv").read_text().splitlines()) == 1 + 6 * (3 + 5)


def test_muscles_in_contact_do_without_one_that_failed(scene_file, tmp_path, monkeypatch):
    text = scene_file.read_text().replace('units = "mm"', 'units = "mm"\nmuscle_contact = "measure"')
    scene_file.write_text(text)
    going_astray(monkeypatch, at=15.0)
    result = Scene.load(scene_file).run(workers=1, sense=False)  # both are the same muscle
    assert result.finished("other") == 5
    assert result.verdicts["spindle"] == "failed"


@pytest.mark.parametrize("step", [2.0, 10.0, 18.0])
def test_a_moment_arm_that_goes_as_a_cosine_does_not_jump_whatever_the_step(step):
    motion = hinge("femur", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), np.arange(0.0, 91.0, step))
    # A muscle from 40 mm beside the axis to 60 mm beside it: its length by the law of cosines.
    lengths = np.sqrt(40.0**2 + 60.0**2 - 2 * 40 * 60 * np.cos(np.radians(170.0 - motion.times)))[:, None]
    turns = largest_turns(motion)
    assert turns == pytest.approx(np.radians(step))
    assert length_jumps(lengths, motion.times, even_stretches(motion), turns).max() < 0.5
    snapped = lengths + 40.0 * (motion.times > 40.0)[:, None]
    assert length_jumps(snapped, motion.times, even_stretches(motion), turns).max() > 5.0
