"""What a run calls for the errors of its numbers: further solves beside its own, and estimates of all."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from functools import partial

import numpy as np

from vtkmuscle.accuracy.causes import KINDS, Cause
from vtkmuscle.accuracy.estimates import (
    architecture_estimates,
    arm_estimates,
    causes_known_of_a_run,
    length_estimates,
    rest_estimate,
    volume_estimate,
)
from vtkmuscle.accuracy.pruning import lengths_lost
from vtkmuscle.accuracy.variants import MADE, Solved, moved_landmarks, solved
from vtkmuscle.core.accuracy.estimate import Estimate
from vtkmuscle.core.errors import InputError, fault_of
from vtkmuscle.core.mesh.line_lengths import polyline_lengths
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.moment_arms.of_joints import joint_arms
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.data.arrays import polylines_of
from vtkmuscle.run.memory import check_memory
from vtkmuscle.run.track import MuscleTrack
from vtkmuscle.scene.data import SceneData

#: Fewest runs of which a standard deviation says anything.
_FEWEST = 3


class ErrorStudy:
    """The errors of a run's lengths, moment arms, volumes and areas.

    Parameters
    ----------
    scene : SceneData
        What is run.
    kinds : iterable of str, optional
        Causes that take further solves, of :data:`~vtkmuscle.accuracy.causes.KINDS`.
    landmark_error : float, optional
        By how much areas are moved, where the kind ``"landmarks"`` is asked for [mm].
    landmark_samples : int, optional
        How often, 3 or more.

    Raises
    ------
    ValueError
        If there is no such kind, or what landmarks are moved by says nothing.
    """

    def __init__(
        self,
        scene: SceneData,
        kinds: Iterable[str] = (),
        *,
        landmark_error: float = 5.0,
        landmark_samples: int = 8,
    ) -> None:
        wanted = set(kinds)
        for kind in sorted(wanted.difference(KINDS)):
            raise InputError("errors", f"there is no kind {kind!r}", suggestion(kind, KINDS))
        if not (np.isfinite(landmark_error) and landmark_error > 0.0):
            problem = f"it is {landmark_error!r}, but must be a positive number of millimetres"
            raise InputError("landmark_error", problem)
        if landmark_samples < _FEWEST:
            raise InputError("landmark_samples", f"it is {landmark_samples!r}, but must be {_FEWEST} or more")
        self.scene = scene
        self.kinds = tuple(kind for kind in KINDS if kind in wanted)
        self.landmark_error, self.landmark_samples = landmark_error, landmark_samples
        self._found: dict[tuple[str, str], list[Solved]] = {}
        self._failed: dict[tuple[str, str], str] = {}

    def jobs(self, numbers: range, stop: threading.Event) -> dict[str, Callable[[], None]]:
        """Return the further solves of some frames, which do not depend on each other, by their names.

        Parameters
        ----------
        numbers, stop
            As of :func:`~vtkmuscle.accuracy.variants.solved`.
        """
        jobs: dict[str, Callable[[], None]] = {}
        for name, muscle in self.scene.muscles.items():
            if muscle.fibres is None:
                continue
            for kind in self.kinds:
                if kind in MADE:
                    make = partial(MADE[kind], self.scene, name)
                    jobs[f"errors.{name}.{kind}"] = self._job(name, kind, 0, make, numbers, stop)
            for sample in range(self.landmark_samples if "landmarks" in self.kinds else 0):
                rng = np.random.default_rng([sample, *name.encode()])
                make = partial(moved_landmarks, self.scene, name, distance=self.landmark_error, rng=rng)
                key = f"errors.{name}.landmarks.{sample}"
                jobs[key] = self._job(name, "landmarks", sample, make, numbers, stop)
        return jobs

    def _job(
        self,
        name: str,
        kind: str,
        number: int,
        make: Callable[[], SceneData],
        numbers: range,
        stop: threading.Event,
    ) -> Callable[[], None]:
        count = self.landmark_samples if kind == "landmarks" else 1
        places = self._found.setdefault((name, kind), [None] * count)  # type: ignore[list-item]

        def solve() -> None:
            try:
                variant = make()
                check_memory(variant, numbers)
                places[number] = solved(variant, name, numbers, stop)
            except ValueError as error:
                problem, _ = fault_of(error, placed=True)
                self._failed[name, kind] = problem

        return solve

    def estimates(
        self,
        name: str,
        track: MuscleTrack,
        motion: RigidMotion,
    ) -> dict[str, Estimate]:
        """Return what is known of a muscle's errors, and say in its report what is not.

        Parameters
        ----------
        name : str
            Of the muscle.
        track : MuscleTrack
            Its frames, with the report.
        motion : RigidMotion
            At the kept frames.
        """
        track.report["errors"] = {}
        estimates = {"volume": volume_estimate(track, self.scene.millimetres)}
        if track.lengths and track.rest_fibres is not None:
            causes = self._causes(name, track)
            lengths = np.array(track.lengths)
            estimates |= length_estimates(lengths, causes)
            rested = polylines_of(track.rest_fibres, "fibres")
            rest = polyline_lengths(rested.points, rested.offsets) * self.scene.millimetres
            at_rest = rest_estimate(rest, causes)
            estimates |= architecture_estimates(track.report["architecture"], estimates["volume"], at_rest)
            if len(lengths) == len(motion.times) and "moment_arms" in track.report:
                estimates |= arm_estimates(lengths, causes, self._arms(name, motion))
        track.report["errors"] = {
            quantity: one.report() for quantity, one in estimates.items() if not quantity.startswith("fibre_")
        }
        track.report["errors_not_known"] = self._not_known(name)
        return estimates

    def _causes(self, name: str, track: MuscleTrack) -> list[Cause]:
        """Return all causes that are known, their lengths in the frames that the muscle has."""
        count, scene = len(track.lengths), self.scene
        causes = causes_known_of_a_run(track, scene.millimetres)
        for kind in self.kinds:
            found = self._found.get((name, kind), [])
            if found and (name, kind) not in self._failed:
                causes.append(
                    Cause(kind, [one.lengths[:count] for one in found], [one.rest for one in found])
                )
        if "pruning" in self.kinds and track.points:
            assert track.rest is not None
            assert track.rest_fibres is not None
            tolerance = track.report["parameters"]["fibres"]["weight_tolerance"]
            lost = lengths_lost(track.rest_fibres, track.rest, track.points, tolerance) * scene.millimetres
            causes.append(Cause("pruning", [np.array(track.lengths) + lost]))
        if any(cause.name == "slices" for cause in causes):  # which has twice the segments
            causes = [cause for cause in causes if cause.name != "segments"]
        return causes

    def _arms(self, name: str, motion: RigidMotion) -> Callable[[Floats], dict[str, JointArms]]:
        crossed = self.scene.muscles[name].crosses
        return lambda lengths: joint_arms(lengths, motion, crossed=crossed)[0]

    def _not_known(self, name: str) -> dict[str, str]:
        """Return the causes whose part is not known, and why."""
        reasons = dict.fromkeys(KINDS, "not asked for")
        if self.scene.model == "paths":
            reasons["pruning"] = "the model 'paths' has none"
        return {
            kind: self._failed.get((name, kind), why)
            for kind, why in reasons.items()
            if kind not in self.kinds or (name, kind) in self._failed
        }
