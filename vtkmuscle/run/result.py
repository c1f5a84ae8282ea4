"""What a run of a scene gives back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.fibre_measures import smoothed_curve
from vtkmuscle.core.rigid import RigidMotion
from vtkmuscle.filters.arrays import with_points
from vtkmuscle.filters.bone_motion import BoneMotion

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
    """

    rest: vtkPolyData | None = None
    rest_fibres: vtkPolyData | None = None
    points: list[Floats] = field(default_factory=list)
    fibres: list[vtkPolyData] = field(default_factory=list)
    lengths: list[Floats] = field(default_factory=list)
    report: dict[str, Any] = field(default_factory=dict)


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
        See :func:`vtkmuscle.run.report.run_report`.

    Attributes
    ----------
    name, units, report
        As given.
    frames : list of int
        Numbers of the kept frames in the motion; the methods below take positions in this list.
    times : list of float
        Their pipeline times.
    muscle_names : list of str
        In the order of the scene.
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
    ) -> None:
        self.name = name
        self.units = units
        self.report: Mapping[str, Any] = report
        self.frames = list(frames)
        self.times: Sequence[float] = [float(motion.times[frame]) for frame in self.frames]
        self.muscle_names: Sequence[str] = list(tracks)
        self.lengths: Mapping[str, Floats] = {
            name: np.array(track.lengths) for name, track in tracks.items() if track.lengths
        }
        self._tracks = tracks
        self._bones = bones
        self._mover = BoneMotion(motion=motion)
        self._mover.connect(0, bones)

    def __repr__(self) -> str:
        muscles = ", ".join(self.muscle_names)
        return f"Result({self.name!r}: {len(self.times)} frames of {muscles})"

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

    def muscle(self, name: str, i: int) -> vtkPolyData:
        """Return a muscle in a kept frame, with the arrays it has at rest (``FixedTo`` and its own)."""
        track = self._tracks[name]
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
