"""What a run of a scene gives back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.fibres.measures import smoothed_curve
from vtkmuscle.core.moment_arms.of_joints import JointArms, joint_arms
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.data.arrays import with_points
from vtkmuscle.filters.bone_motion import BoneMotion
from vtkmuscle.io.literature import LiteratureCurve
from vtkmuscle.run.moment_arms import MomentArmTable

Floats = NDArray[np.float64]


@dataclass(eq=False)
class MuscleTrack:
    """The finished frames of one muscle.

    Attributes
    ----------
    rest : vtkPolyData or None
        At rest, with the point array ``FixedTo``.
    rest_fibres : vtkPolyData or None
        Fibres at rest.
    points : list of (n, 3) array
        Points per finished frame.
    fibres : list of vtkPolyData
        Fibres per finished frame, empty for a muscle without fibres.
    lengths : list of (k,) array
        Fibre lengths per finished frame [mm].
    report : dict
        What is known of the muscle, JSON-able.
    failure : (int, float, Exception) or None
        Frame and time that could not be computed, and why; the frames before are there.
    """

    rest: vtkPolyData | None = None
    rest_fibres: vtkPolyData | None = None
    points: list[Floats] = field(default_factory=list)
    fibres: list[vtkPolyData] = field(default_factory=list)
    lengths: list[Floats] = field(default_factory=list)
    report: dict[str, Any] = field(default_factory=dict)
    failure: tuple[int, float, Exception] | None = None


class Result:
    """The muscles, fibres and bones of a run, frame by frame, and its report.

    Parameters
    ----------
    name : str
        Name of the scene.
    units : str
        Unit of all coordinates.
    bones : vtkMultiBlockDataSet
        The bones at rest.
    motion : RigidMotion
        How they move.
    frames : sequence of int
        Numbers of the frames that were kept.
    tracks : dict of str to MuscleTrack
        What became of each muscle.
    report : dict
        What was measured; ``report["definitions"]`` says what each number means.
    literature : mapping of str to sequence of LiteratureCurve, optional
        Published moment arms per muscle.

    Attributes
    ----------
    name, units, report, motion, literature
        As given.
    frames : list of int
        Numbers of the kept frames in the motion; the methods below take positions in this list.
    times : list of float
        Their pipeline times.
    time_label : str
        What these are: a coordinate with its unit, where they are one.
    muscle_names : list of str
        In the order of the scene.
    verdicts : dict of str to str
        Of each muscle ``"ok"``, ``"look"`` or ``"failed"``; ``report["muscles"][NAME]["verdict"]`` says why.
    lengths : dict of str to (frames, fibres) array
        Fibre lengths [mm] of the muscles that have fibres.
    """

    def __init__(
        self,
        name: str,
        units: str,
        bones: vtkMultiBlockDataSet,
        motion: RigidMotion,
        frames: Sequence[int],
        tracks: dict[str, MuscleTrack],
        report: dict[str, Any],
        *,
        literature: Mapping[str, Sequence[LiteratureCurve]] | None = None,
    ) -> None:
        self.name = name
        self.motion = motion
        self.time_label = _time_label(motion)
        self.literature: Mapping[str, Sequence[LiteratureCurve]] = dict(literature or {})
        self.units = units
        self.report: Mapping[str, Any] = report
        self.frames: Sequence[int] = list(frames)
        self.times: Sequence[float] = [float(motion.times[frame]) for frame in self.frames]
        self.muscle_names: Sequence[str] = list(tracks)
        self.lengths: Mapping[str, Floats] = {
            name: np.array(track.lengths) for name, track in tracks.items() if track.lengths
        }
        self.verdicts: Mapping[str, str] = {
            name: track.report["verdict"]["verdict"] for name, track in tracks.items()
        }
        self._tracks = tracks
        self._bones = bones
        self._mover = BoneMotion(motion=motion)
        self._mover.connect(0, bones)

    def __repr__(self) -> str:
        muscles = ", ".join(f"{name} ({self.verdicts[name]})" for name in self.muscle_names)
        return f"Result({self.name!r}: {len(self.times)} frames of {muscles})"

    def finished(self, name: str) -> int:
        """Return how many of the kept frames a muscle has: all, or those before the one that failed."""
        return len(self._tracks[name].report["frames"])

    def smoothed_lengths(self, *, passes: int = 5) -> dict[str, Floats]:
        """Return the fibre lengths without their noise over the frames.

        Parameters
        ----------
        passes : int, optional
            How often l_i becomes (l_{i-1} + 4 l_i + l_{i+1}) / 6, the ends kept; P21, section 4.4, has five.

        Returns
        -------
        dict of str to (frames, fibres) array
            As ``lengths`` [mm].
        """
        return {name: smoothed_curve(lengths, passes=passes) for name, lengths in self.lengths.items()}

    def moment_arms(self, *coordinates: str) -> MomentArmTable:
        """Return the moment arms of all fibres, -dl/dq, over the kept frames.

        Parameters
        ----------
        *coordinates : str
            Names of coordinates of the motion; default: all that change.

        Returns
        -------
        MomentArmTable
            Per muscle and coordinate arms, standard errors and a quartic fit [mm], see
            :class:`~vtkmuscle.core.moment_arms.of_joints.JointArms`; ``write``, ``columns`` and ``to_frame``
            give a table.

        Raises
        ------
        ValueError
            If no muscle has fibres, the motion has no such coordinate or none that changes, or the frames
            have too few different values of it.
        """
        if not self.lengths:
            raise ValueError("no muscle of the run has fibres, so there are no moment arms; give it fibres")
        motion = self.motion.part(self.frames)
        arms: dict[str, dict[str, JointArms]] = {}
        refused: dict[str, str] = {}
        for name, lengths in self.lengths.items():
            if len(lengths) < len(self.frames):
                continue  # it failed on the way
            arms[name], refused = joint_arms(lengths, motion, coordinates or None)
        return MomentArmTable(arms, refused)

    def muscle(self, name: str, i: int) -> vtkPolyData:
        """Return a muscle in a kept frame, with the arrays it has at rest (``FixedTo`` and its own).

        Raises
        ------
        ValueError
            If the scene's model is ``"paths"``, which deforms no muscle.
        """
        track = self._tracks[name]
        if self.report["model"] == "paths":
            raise ValueError(
                f"the scene's model is 'paths', so that {name!r} was not deformed; fibres({name!r}, {i}) has "
                "its fibres, and model 'volume' deforms it"
            )
        moved: vtkPolyData = with_points(track.rest, track.points[i])
        return moved

    def fibres(self, name: str, i: int) -> vtkPolyData | None:
        """Return the fibres of a muscle in a kept frame, None where it has none."""
        track = self._tracks[name]
        return track.fibres[i] if track.fibres else None

    def bones(self, i: int) -> vtkMultiBlockDataSet:
        """Return the bones in a kept frame, each with the field array ``Transform``."""
        moved = vtkMultiBlockDataSet()
        moved.ShallowCopy(self._mover.update(time=self.times[i]).output)
        return moved

    def rest_muscle(self, name: str) -> vtkPolyData:
        """Return a muscle at rest, with the point array ``FixedTo``."""
        rest = self._tracks[name].rest
        assert rest is not None  # a result is made when all muscles are done
        return rest

    def rest_fibres(self, name: str) -> vtkPolyData | None:
        """Return the fibres of a muscle at rest, None where it has none."""
        return self._tracks[name].rest_fibres

    def rest_bones(self) -> vtkMultiBlockDataSet:
        """Return the bones at rest."""
        return self._bones


def _time_label(motion: RigidMotion) -> str:
    for name, one in motion.coordinates.items():
        if np.array_equal(one.values, motion.times):
            return f"{name.replace('_', ' ')} [{one.unit}]"
    return "time"
