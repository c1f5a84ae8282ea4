"""What a run calls for the errors of its numbers: further solves beside its own, and estimates of all."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial

import numpy as np

from vtkmuscle.accuracy.causes import KINDS, Cause
from vtkmuscle.accuracy.estimates import (
    architecture_estimates,
    arm_estimates,
    causes_of_fibres,
    causes_of_paths,
    length_estimates,
    rest_estimate,
    volume_estimate,
)
from vtkmuscle.accuracy.pruning import lengths_lost
from vtkmuscle.accuracy.variants import MADE, Solution, moved_landmarks, solved
from vtkmuscle.core.accuracy.estimate import Estimate
from vtkmuscle.core.errors import InputError, fault_of
from vtkmuscle.core.mesh.line_lengths import polyline_lengths
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.moment_arms.of_joints import joint_arms, known_coordinates, slopes_by
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.data.arrays import polylines_of
from vtkmuscle.data.paths import wrenches_over_time
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
        self._found: dict[tuple[str, str], list[Solution]] = {}
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
        if track.fibre_lengths and track.rest_fibres is not None:
            causes = self._causes_of_fibres(name, track)
            lengths = np.array(track.fibre_lengths)
            estimates |= length_estimates("fibre_length", lengths, causes)
            rested = polylines_of(track.rest_fibres, "fibres")
            rest = polyline_lengths(rested.points, rested.offsets) * self.scene.millimetres
            at_rest = rest_estimate(rest, causes)
            estimates |= architecture_estimates(track.report["architecture"], estimates["volume"], at_rest)
        if track.lengths:
            causes = self._causes_of_paths(name, track, motion)
            lengths = np.array(track.lengths)
            estimates |= length_estimates("length", lengths, causes)
            if "moment_arms" in track.report:
                known = self._arms(name, motion, lengths, wrenches_over_time(track.wrenches))
                estimates |= arm_estimates(known, causes, self._slopes(name, motion, known))
        track.report["errors"] = {
            quantity: one.report() for quantity, one in estimates.items() if not quantity.startswith("each_")
        }
        track.report["errors_not_known"] = self._not_known(name)
        return estimates

    def _causes_of_fibres(self, name: str, track: MuscleTrack) -> list[Cause]:
        """Return all causes that are known, their lengths of fibres in the frames that the muscle has."""
        count, scene = len(track.fibre_lengths), self.scene
        causes = causes_of_fibres(track, scene.millimetres)
        causes += [
            Cause(kind, [one.fibre_lengths[:count] for one in found], [one.rest for one in found])
            for kind, found in self._solved_kinds(name)
        ]
        if "pruning" in self.kinds and track.points:
            assert track.rest is not None
            assert track.rest_fibres is not None
            tolerance = track.report["parameters"]["fibres"]["weight_tolerance"]
            lost = lengths_lost(track.rest_fibres, track.rest, track.points, tolerance) * scene.millimetres
            causes.append(Cause("pruning", [np.array(track.fibre_lengths) + lost]))
        if any(cause.name == "slices" for cause in causes):  # which has twice the segments
            causes = [cause for cause in causes if cause.name != "segments"]
        return causes

    def _causes_of_paths(self, name: str, track: MuscleTrack, motion: RigidMotion) -> list[Cause]:
        """Return all causes that are known, their lengths and moment arms of paths.

        Of the kind ``"model"`` these are the lengths of the fibres in the muscle.
        """
        count, scene = len(track.lengths), self.scene
        causes = causes_of_paths(track, scene.millimetres)
        for kind, found in self._solved_kinds(name):
            if kind == "model":
                deformed = [one.fibre_lengths[:count] for one in found]
                mine = [np.array(track.fibre_lengths)]
                causes.append(Cause(kind, deformed if scene.model == "paths" else mine))
            else:
                arms = []
                if "moment_arms" in track.report:
                    arms = [self._arms(name, motion, one.lengths, one.wrenches) for one in found]
                causes.append(Cause(kind, [one.lengths[:count] for one in found], arms=arms))
        return causes

    def _solved_kinds(self, name: str) -> Iterator[tuple[str, list[Solution]]]:
        """Give the kinds that were solved for a muscle, and what came out."""
        for kind in self.kinds:
            found = self._found.get((name, kind), [])
            if found and (name, kind) not in self._failed:
                yield kind, found

    def _arms(
        self, name: str, motion: RigidMotion, lengths: Floats, wrenches: Mapping[str, Floats]
    ) -> dict[str, JointArms]:
        crossed = self.scene.muscles[name].crosses
        millimetres = self.scene.millimetres
        return joint_arms(lengths, wrenches, motion, crossed=crossed, millimetres=millimetres)[0]

    def _slopes(
        self, name: str, motion: RigidMotion, known: Mapping[str, JointArms]
    ) -> Callable[[str, Floats], Floats]:
        """Return what gives -dl/dq by a coordinate, where its moment arms are known."""
        crossed = self.scene.muscles[name].crosses

        def slopes(coordinate: str, lengths: Floats) -> Floats:
            among = known_coordinates(motion, crossed)
            return slopes_by(motion, coordinate, among, lengths)[known[coordinate].frames]

        return slopes

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
