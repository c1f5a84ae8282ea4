"""Runs over one another: differences by known answers, and a figure of them."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest

import vtkmuscle
from vtkmuscle.core.moment_arms.of_joints import JointArms
from vtkmuscle.core.motion.coordinates import Coordinate

ANGLES = np.linspace(0.0, 60.0, 7)


@dataclass
class Made:
    """What a comparison takes of a result, its moment arms and lengths lines over the angle."""

    slope: float = 0.5
    muscle: str = "vastus_r"
    coordinate: str = "knee_angle_r"
    angles: np.ndarray = field(default_factory=lambda: ANGLES)
    unit: str = "deg"

    def __post_init__(self):
        self.name, self.muscle_names, self.verdicts = "made", [self.muscle], {self.muscle: "ok"}
        self.frames, self.times = range(len(self.angles)), list(self.angles)
        self.time_label = f"{self.coordinate.replace('_', ' ')} [deg]"
        self.literature, self.crosses = {}, {}
        self.report = {"muscles": {self.muscle: {"moment_arms": {}}}}
        rows = self.slope * self.angles[:, None] + np.array([-2.0, 0.0, 2.0])
        self.lengths = {self.muscle: 100.0 + rows}
        self.fibre_lengths = {}
        values = self.angles if self.unit == "deg" else np.radians(self.angles)
        self.motion = SimpleNamespace(coordinates={self.coordinate: Coordinate(values, self.unit)})
        of = self.coordinate, self.unit, "", np.arange(len(rows)), values, np.ones(len(rows))
        arms = JointArms(*of, *np.zeros((2, len(rows))), rows, rows, None, None)
        self.report["muscles"][self.muscle]["moment_arms"] = {self.coordinate: {}}
        self.all_arms = {self.muscle: {self.coordinate: arms}}


def test_runs_differ_by_what_they_differ_by():
    other = Made(0.6)
    other.lengths["vastus_r"][3] = np.nan  # whose paths did not come to rest
    table = vtkmuscle.compare({"one": Made(0.5), "other": other}).table()
    lengths = table.where(quantity="length, bone to bone", run="other")
    assert lengths["difference"][0] == pytest.approx(0.1 * np.delete(ANGLES, 3).mean())
    arms = table.where(quantity="moment arm, knee angle", run="other")
    assert arms["difference"][0] == pytest.approx(0.1 * ANGLES.mean())
    assert arms["difference_largest"][0] == pytest.approx(6.0)
    assert arms["at"][0] == 60.0
    assert arms["difference_rms"][0] == pytest.approx(0.1 * np.sqrt(np.mean(ANGLES**2)))
    assert np.isnan(table.where(run="one")["difference"]).all()


def test_sides_are_compared_and_other_frames_met_between():
    left = Made(0.5, "vastus_l", "knee_angle_l", angles=np.linspace(-5.0, 33.0, 11))
    table = vtkmuscle.compare({"right": Made(), "left": left}).table()
    assert set(table["muscle"]) == {"vastus"}
    apart = table.where(run="left", quantity="moment arm, knee angle")
    assert apart["difference_rms"][0] == pytest.approx(0.0, abs=1e-12)


def test_both_sides_of_one_run_are_two_runs():
    """Both muscles have moment arms by the coordinates of both sides."""
    both, other = Made(), Made(0.7, "vastus_left", "knee_angle_l")
    both.muscle_names = ["vastus_r", "vastus_left"]
    both.verdicts |= other.verdicts
    both.lengths |= other.lengths
    both.motion.coordinates |= other.motion.coordinates
    arms = both.all_arms["vastus_r"] | other.all_arms["vastus_left"]
    both.all_arms = dict.fromkeys(both.muscle_names, arms)
    table = vtkmuscle.compare({"walk": both}).table()
    assert {"moment arm, left knee angle", "moment arm, right knee angle"} < set(table["quantity"])
    own = table.where(quantity="moment arm, knee angle")
    assert list(own["run"]) == ["walk", "walk, vastus_left"]
    assert own["difference_largest"][1] == pytest.approx(0.2 * 60.0)


def test_lengths_over_different_coordinates_are_not_subtracted():
    runs = {"one": Made(), "other": Made(coordinate="hip_angle_r"), "third": Made(0.6)}
    table = vtkmuscle.compare(runs).table()
    assert np.isnan(table.where(run="other")["difference"]).all()
    assert table.where(run="third")["difference"] == pytest.approx(0.1 * ANGLES.mean())


def over_grid(step, slope=0.5, unit="mm"):
    """Return a run over a knee and a slide in turns; the moment arm depends on both."""
    slide, knee = (
        axis.ravel() for axis in np.meshgrid(np.arange(0.0, 41.0, step), [0.0, 20.0], indexing="ij")
    )
    knee[2::4], knee[3::4] = 20.0, 0.0
    run = Made(slope, angles=slide + knee)
    run.times, run.time_label = list(range(len(slide))), "time"
    slid = Coordinate(slide * {"mm": 1.0, "m": 0.001}[unit], unit)
    run.motion.coordinates = {"knee_angle_r": Coordinate(knee, "deg"), "slide_r": slid}
    run.all_arms[run.muscle]["knee_angle_r"] = replace(run.all_arms[run.muscle]["knee_angle_r"], values=knee)
    return run


def test_runs_over_grids_are_compared_in_equal_poses():
    """A run over a coordinate of a grid has many values at a position, and no value between poses."""
    runs = {"one": over_grid(10.0), "same": over_grid(10.0), "coarse": over_grid(20.0, 0.6, unit="m")}
    table = vtkmuscle.compare(runs).table()
    assert set(table["over"]) == {"poses of knee angle, slide"}
    assert table.where(run="same")["difference_rms"].tolist() == [0.0, 0.0]
    np.testing.assert_allclose(table.where(run="coarse")["difference"], 0.1 * 30.0)


def test_lengths_and_arms_of_a_held_coordinate_are_compared_over_the_moving_one():
    runs = {name: Made(angles=np.arange(0.0, 61.0, step)) for name, step in (("one", 10), ("other", 5))}
    for run in runs.values():  # a grid of the knee and of a single value
        run.times, run.time_label, arms = list(run.frames), "pose", run.all_arms[run.muscle]
        run.motion.coordinates["slide"] = Coordinate(0.0 * run.angles, "mm")
        arms["slide"] = replace(arms["knee_angle_r"], values=0.0 * run.angles)
    table = vtkmuscle.compare(runs).table()
    assert set(table["over"]) == {"knee angle [degrees]"}
    np.testing.assert_allclose(table.where(run="other")["difference_rms"], 0.0, atol=1e-12)


def test_a_muscle_without_a_frame_has_a_row():
    failed = Made()
    failed.lengths, failed.all_arms, failed.verdicts = {}, {}, {failed.muscle: "failed"}
    compared = vtkmuscle.compare({"one": Made(), "other": failed})
    assert compared.table().where(run="other")["verdict"].tolist() == ["failed"]
    assert len(compared.figure().axes) == 2


def test_angles_in_radians_are_compared_in_degrees():
    arms = vtkmuscle.compare({"one": Made(), "other": Made(unit="rad")}).table().where(run="other")
    assert arms["difference_rms"][-1] == pytest.approx(0.0, abs=1e-12)


def test_nothing_in_common_is_one_clear_error():
    with pytest.raises(ValueError, match=r"no muscle is in two .*one: vastus_r; other: psoas"):
        vtkmuscle.compare({"one": Made(), "other": Made(muscle="psoas")})
    scene = vtkmuscle.Scene.from_phantom(vtkmuscle.phantoms.spindle_over_hinge())
    for given in (scene, [scene], {"one": scene}, [3]):
        with pytest.raises(TypeError, match=r"takes results or their folders, not .*; run a scene first"):
            vtkmuscle.compare(given)


def test_a_table_and_a_figure_are_written(tmp_path):
    published = tmp_path / "published.csv"
    published.write_text("source,muscle,dof,angle_deg,moment_arm_mm\nA1999,vastus,knee_angle,5,30\n")
    other = Made(0.6)
    compared = vtkmuscle.compare({"one": Made(), "other": other}, literature=published)
    other.literature = {other.muscle: compared.literature["vastus"]}
    assert vtkmuscle.compare({"one": Made(), "other": other}).literature == compared.literature
    table, picture = compared.write(tmp_path / "out")
    assert len(table.read_text().splitlines()) == 1 + 2 * 2
    assert picture.read_bytes().startswith(b"\x89PNG")
    lengths, arms = compared.figure().axes
    assert [line.get_label() for line in lengths.lines] == ["one", "other"]
    assert [line.get_label() for line in arms.lines] == ["one", "other", "A1999"]
    np.testing.assert_allclose(arms.lines[1].get_xydata(), np.column_stack([ANGLES, 0.6 * ANGLES]))
    low, high = arms.get_ylim()
    assert low <= 0.0
    assert high >= 36.0
    assert (arms.get_xlabel(), arms.get_ylabel()) == ("knee angle [degrees]", "moment arm, knee angle [mm]")
