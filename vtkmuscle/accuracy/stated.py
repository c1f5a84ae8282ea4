"""The errors of a run's numbers, from the run and from further solves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from vtkmuscle.accuracy.estimates import (
    KINDS,
    Cause,
    Slopes,
    architecture_estimates,
    arm_estimates,
    chord_errors,
    length_estimates,
    rest_estimate,
    volume_estimate,
)
from vtkmuscle.core.estimate import Estimate, segment_errors
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.moment_arms.of_joints import known_coordinates, slopes_by
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import polylines_of
from vtkmuscle.run.frames import MuscleTrack
from vtkmuscle.scene.data import SceneData


@dataclass(frozen=True, eq=False)
class Solution:
    """A further solve: lengths of paths and fibres (f, k), of fibres at rest (k,) [mm], and moment arms."""

    lengths: Floats
    fibre_lengths: Floats
    rest: Floats
    arms: Mapping[str, JointArms]


class StatedErrors:
    """The errors of a run's lengths, moment arms, volumes and areas.

    Parameters
    ----------
    scene : SceneData
        The scene of the run.
    kinds : sequence of str, optional
        Causes beside those that are always known, of :data:`~vtkmuscle.accuracy.estimates.KINDS`.
    solutions : mapping of (str, str) to sequence of Solution, optional
        The further solves by muscle and kind.
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

    def estimates(
        self, name: str, track: MuscleTrack, motion: RigidMotion, arms: Mapping[str, JointArms]
    ) -> dict[str, Estimate]:
        """Return the estimates of a muscle's quantities, and put them into its report.

        ``motion`` is that at the kept frames, ``arms`` the moment arms of the muscle by coordinate.
        """
        scale = self.scene.millimetres
        estimates = {"volume": volume_estimate(track, scale)}
        if track.fibre_lengths and track.rest_fibres is not None:
            of_fibres, of_paths = chord_errors(track, scale)
            rested = polylines_of(track.rest_fibres, "fibres")
            rest = polyline_lengths(rested.points, rested.offsets)
            arcs = (rest + segment_errors(rested.points, rested.offsets)) * scale
            lengths = np.array(track.fibre_lengths)
            causes = self._causes_of_fibres(name, Cause("segments", [lengths + of_fibres], [arcs]))
            estimates |= length_estimates("fibre_length", lengths, causes)
            at_rest = rest_estimate(rest * scale, causes)
            estimates |= architecture_estimates(track.report["architecture"], estimates["volume"], at_rest)
            if track.lengths:
                lengths = np.array(track.lengths)
                segments = Cause("segments", [lengths + of_paths])
                causes = [segments, *self._causes_of_paths(name, track, with_arms=bool(arms))]
                estimates |= length_estimates("length", lengths, causes)
                estimates |= arm_estimates(arms, causes, self._slopes(name, motion, arms))
        track.report["errors"] = {
            quantity: one.report() for quantity, one in estimates.items() if not quantity.startswith("each_")
        }
        track.report["errors_not_known"] = {
            kind: self.failed.get((name, kind), "not asked for")
            for kind in KINDS
            if kind not in self.kinds or (name, kind) in self.failed
        }
        return estimates

    def _causes_of_fibres(self, name: str, segments: Cause) -> list[Cause]:
        """Return the known causes of errors of fibres, in the frames that the muscle has."""
        count = len(segments.lengths[0])
        causes = [
            Cause(kind, [one.fibre_lengths[:count] for one in found], [one.rest for one in found])
            for kind, found in self._solved_kinds(name)
        ]
        # Fibres of the kind "slices" have twice the segments.
        return causes if any(cause.name == "slices" for cause in causes) else [segments, *causes]

    def _causes_of_paths(self, name: str, track: MuscleTrack, *, with_arms: bool) -> Iterator[Cause]:
        """Give the causes that further solves tell; for "model" the lengths are those of fibres."""
        count = len(track.lengths)
        for kind, found in self._solved_kinds(name):
            if kind != "model":
                arms = [one.arms for one in found] if with_arms else []
                yield Cause(kind, [one.lengths[:count] for one in found], arms=arms)
            elif self.scene.deformer == "none":
                yield Cause(kind, [one.fibre_lengths[:count] for one in found])
            else:
                yield Cause(kind, [np.array(track.fibre_lengths)])

    def _solved_kinds(self, name: str) -> Iterator[tuple[str, Sequence[Solution]]]:
        """Give the kinds that were solved for a muscle, with the solutions."""
        for kind in self.kinds:
            if found := self.solutions.get((name, kind)):
                yield kind, found

    def _slopes(self, name: str, motion: RigidMotion, known: Mapping[str, JointArms]) -> Slopes:
        """Return the function that gives -dl/dq by a coordinate, at the frames of its moment arms."""
        crossed = self.scene.muscles[name].crosses

        def slopes(coordinate: str, lengths: Floats) -> Floats:
            among = known_coordinates(motion, crossed)
            return slopes_by(motion, coordinate, among, lengths)[known[coordinate].frames]

        return slopes
