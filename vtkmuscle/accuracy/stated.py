"""The errors of a run's numbers: what is known from the run, and from further solves where there are any."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from vtkmuscle.accuracy.estimates import (
    KINDS,
    Cause,
    architecture_estimates,
    arm_estimates,
    causes_of_fibres,
    causes_of_paths,
    length_estimates,
    rest_estimate,
    volume_estimate,
)
from vtkmuscle.core.estimate import Estimate
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.moment_arms.of_joints import joint_arms, known_coordinates, slopes_by
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import polylines_of
from vtkmuscle.data.paths import wrenches_over_time
from vtkmuscle.run.tracks import MuscleTrack
from vtkmuscle.scene.data import SceneData


@dataclass(frozen=True, eq=False)
class Solution:
    """What a further solve of a muscle gives, in the frames of the run.

    Attributes
    ----------
    lengths, fibre_lengths : (f, k) arrays
        Of the paths and of the fibres [mm].
    rest : (k,) array
        Of the fibres at rest [mm].
    arms : dict of str to JointArms
        Of the paths by coordinate.
    """

    lengths: Floats
    fibre_lengths: Floats
    rest: Floats
    arms: Mapping[str, JointArms]


class StatedErrors:
    """The errors of a run's lengths, moment arms, volumes and areas.

    Parameters
    ----------
    scene : SceneData
        What is run.
    kinds : sequence of str, optional
        Causes beside those that are always known, of :data:`~vtkmuscle.accuracy.estimates.KINDS`.
    solutions : mapping of (str, str) to sequence of Solution, optional
        By muscle and kind what further solves gave.
    failed : mapping of (str, str) to str, optional
        Why there are none.
    """

    def __init__(
        self,
        scene: SceneData,
        kinds: Sequence[str] = (),
        solutions: Mapping[tuple[str, str], Sequence[Solution]] = MappingProxyType({}),
        failed: Mapping[tuple[str, str], str] = MappingProxyType({}),
    ) -> None:
        self.scene, self.kinds, self.solutions, self.failed = scene, tuple(kinds), solutions, failed

    def estimates(self, name: str, track: MuscleTrack, motion: RigidMotion) -> dict[str, Estimate]:
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
                arms = [one.arms for one in found] if "moment_arms" in track.report else []
                causes.append(Cause(kind, [one.lengths[:count] for one in found], arms=arms))
        return causes

    def _solved_kinds(self, name: str) -> Iterator[tuple[str, Sequence[Solution]]]:
        """Give the kinds that were solved for a muscle, and what came out."""
        for kind in self.kinds:
            if found := self.solutions.get((name, kind)):
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
        return {
            kind: self.failed.get((name, kind), "not asked for")
            for kind in KINDS
            if kind not in self.kinds or (name, kind) in self.failed
        }
