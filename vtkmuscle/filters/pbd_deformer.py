"""PBDDeformer: a muscle that follows its bones."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.algorithm_2.solver import Algorithm2, State
from vtkmuscle.core.collision.obstacles import Neighbour
from vtkmuscle.core.deformation.muscle import PathDrivenMuscle, Pose
from vtkmuscle.core.errors import InputError, errors_at
from vtkmuscle.core.fixed_muscle import FixedMuscle
from vtkmuscle.core.mesh.rest_shape import ShapeReport
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import Polylines, set_field_array, set_point_array, with_points
from vtkmuscle.data.attachments import rings_by_bone
from vtkmuscle.data.moving_bones import MovingBones, RestBones, fixed_points_of
from vtkmuscle.data.muscle_geometry import Surface
from vtkmuscle.data.paths import path_arrays
from vtkmuscle.filters.base import HistoryFilter, InputPort, OutputPort, ports
from vtkmuscle.filters.deformer.neighbours import Neighbours
from vtkmuscle.filters.deformer.settings import (
    PUBLISHED,
    DeformerSettings,
    algorithm_2_parameters,
    check_together,
)
from vtkmuscle.filters.deformer.shape_report import shape_fields


@dataclass(eq=False)
class _Frame:
    """A state that was computed, the twists of the bones there, and how long that took [ms].

    Its report is there once it was asked for.
    """

    state: Pose | State
    twists: Mapping[str, Floats]
    milliseconds: float
    report: ShapeReport | None = None

    @property
    def nbytes(self) -> int:
        """Memory that it takes [bytes]."""
        return self.state.nbytes


class PBDDeformer(DeformerSettings, HistoryFilter[_Frame]):
    """Deform a muscle with the bones it is fixed to.

    Points with a ``FixedTo`` follow their bone. The others are carried by the muscle's paths: each fibre is
    pulled taut from bone to bone, round the bones, from which it keeps away by what of the muscle lies
    between at rest. Then the muscle *settles*: it gets its volume back and leaves the bones, and what that
    moves its points by diffuses over the surface in a number of rounds, so that the surface stays smooth. A
    frame depends on its pose, and on the frames before by its paths only.

    The fibres are those connected as ``fibres``; where there are none, lines over the surface stand in for
    them, along the harmonic function between the points fixed to different bones. Where those are fixed to
    one bone only, that bone takes the muscle with it.

    ``quality="published"`` is another model: Algorithm 2 of Kohout and Cervenka 2021 as printed, by position
    based dynamics, with no paths. A frame goes on from the one before with its velocities. The parameters
    that are said to count only with it are those of the paper.

    ``quality`` sets ``collision``, ``iterations`` and ``taut_resolution``. Those that are given to the
    constructor beside it count more, and one that is set afterwards is kept until ``quality`` is set again.

    The frame at time t is computed from rest through all time steps that the bones announce up to t, and t
    itself, whatever was asked for before. Frames are kept to go back to, in memory of ``checkpoint_memory``;
    one takes 48 bytes per point, and 48 per point of a path and per path, and 128 per bone. Where it is used
    up, every second frame is dropped, then every second of those.

    ``collision="sdf"`` moves points that are in a bone to its surface, along which they slide. Points that
    are in a bone at rest stay as deep as they are. ``"voxel"`` takes them back the way they came, as
    published, which leaves dents and spikes where a muscle is drawn over a bone.

    Muscles connected as ``neighbours`` stay as they are; this one is kept out of them, except as deep as it
    is in them at rest: ``neighbours={"psoas": psoas, "iliacus": iliacus}``, with their deformers.

    Parameters
    ----------
    muscle
        Closed triangles in the rest pose, with the point array ``FixedTo``: -1 for a free point, else the
        index of a bone's block.
    bones
        Bones at the pipeline's time, each with the field array ``Transform`` (16, row major): rest to now.
        For moment arms they have ``Twist_COORDINATE`` as well, as BoneMotion gives them.
    fibres
        Polylines in the rest pose, for the paths; which edges run along them in the report, and are soft in
        the published model.
    neighbours
        Other muscles at the pipeline's time, out of which this one is kept: outputs of PBDDeformer, with the
        point array ``Displacement``.
    attachments
        For the via rings among them, which the fibres pass through.

    Attributes
    ----------
    output
        The muscle at the time asked for, with the arrays of the input; the point array ``Displacement`` (3)
        from rest [mm]; the field arrays ``VolumeRatio`` (V / V0), ``EdgeStretchP95`` and ``EdgeStretchMax``
        (l / l0), ``AlongFibresP5``, ``AlongFibresP50`` and ``AlongFibresP95`` (of the edges within 18 degrees
        of the fibres), ``AcrossFibresP5``, ``AcrossFibresP50`` and ``AcrossFibresP95`` (over 72 degrees),
        ``DihedralErrorP95`` [degrees], ``DegenerateEdges`` (whose angle was lost as a triangle collapsed),
        ``CollidingPoints``, and ``Milliseconds`` that the frame took. With ``measure_penetration`` also
        ``PenetrationMax`` and ``PenetrationP95`` [mm], how deep the free points are in the closed bones, and
        ``PenetratingPoints``, how many. Where paths carry it also the point array ``Carried`` (3), where they
        do so before it settles [mm], and the field arrays ``FibrePoints`` (p, 3), where they carry the points
        of ``fibres`` [mm], and ``Unsettled``, 1 where the paths did not come to rest; and of the paths, where
        each stands for one of ``fibres``, ``PathLength`` (k,) [mm], ``PathPoints`` (k, 3 n) [mm] and
        ``PathLever_COORDINATE`` (k,), the moment arm by each coordinate of which the bones have the twists.
        With quality 'published' also the point array ``Velocity`` (3) [mm/s].

    Raises
    ------
    ValueError
        If the surface is open, is not made of triangles or encloses no volume; if a coordinate is not
        finite; if ``FixedTo`` is missing or names a block that does not exist; if no point is fixed (nothing
        would hold or move the muscle, but the external force of the published model); if a bone has no
        ``Transform``, one that is not rigid, or points that did not move with it; if ``collision`` is
        "voxel" and ``quality`` not "published".

    References
    ----------
    Kohout, Cervenka 2021, *Muscle Deformation Using Position Based Dynamics*,
    doi:10.1007/978-3-030-72379-8_24.

    Botsch, Sorkine 2008, *On linear variational surface deformation methods*, doi:10.1109/TVCG.2007.1054.

    Examples
    --------
    >>> from vtkmuscle.filters import BoneMotion, FixedPointDetector, PBDDeformer
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> fixed = FixedPointDetector()(muscle, phantom.bones, phantom.attachments[name])
    >>> moving = BoneMotion(bones=phantom.bones, motion=phantom.motion)
    >>> deformed = PBDDeformer(muscle=fixed, bones=moving).apply(time=10.0)
    >>> bool(abs(deformed.field_data["VolumeRatio"][0] - 1.0) < 1e-9)
    True
    """

    muscle = ports.Surface()
    bones = ports.MovingBones()
    fibres = ports.Lines(optional=True)
    neighbours = InputPort(vtkMultiBlockDataSet, optional=True)
    attachments = InputPort(vtkMultiBlockDataSet, optional=True)
    output = OutputPort(vtkPolyData)

    moving = ("bones", "neighbours")

    def __init__(self, **settings: Any) -> None:
        self._muscle: FixedMuscle | None = None
        self._solver: PathDrivenMuscle | Algorithm2 | None = None
        self._made_from: tuple[object, ...] = ()
        self._rest_bones = RestBones(type(self).__name__)
        self._neighbours: Neighbours | None = None
        self._rest_from: float | None = None
        super().__init__(**settings)

    def settings_of_frames(self) -> dict[str, Any]:
        """Return the parameters that a frame depends on."""
        settings = super().settings_of_frames()
        if self.collision != "off":  # the bones at rest are known then
            del settings["measure_penetration"]
        return settings

    def forget(self) -> None:
        """Drop all frames, and what is known of the neighbours."""
        super().forget()
        self._neighbours = None

    # ---------------------------------------------------------------- one frame

    def execute(
        self,
        muscle: Surface,
        bones: MovingBones,
        fibres: Polylines | None,
        neighbours: vtkMultiBlockDataSet | None,
        attachments: vtkMultiBlockDataSet | None,
    ) -> vtkPolyData:
        """Compute the frames on the way to the time asked for that are not known, and return the last."""
        check_together(self.parameters())
        given = FixedMuscle(
            muscle.points,
            muscle.triangles,
            fixed_points_of(muscle, bones.names),
            None if fibres is None else (fibres.points, fibres.offsets),
            rings_by_bone(attachments, bones.names, "attachments"),
        )
        driven = self.quality == PUBLISHED and any(self.external_force)
        if (given.fixed_to < 0).all() and not driven:
            raise InputError(
                "muscle",
                "no point is fixed to a bone, so nothing would hold or move the muscle",
                "detect fixed points by another method or distance",
            )
        if not given.same_as(self._muscle):
            self._muscle, self._solver = given, None
            self.forget()
        first = self.path[0]
        if self._frames.done(self.path) and self._rest_from != first:
            self._take_rest(self.data_at("bones", bones, first))
        return self._result(muscle.data, self.frame((bones, neighbours), self._advance))

    def _take_rest(self, bones: MovingBones) -> None:
        """Take the bones at rest from the first frame of the path, on which their last digits depend."""
        self._rest_from = self.path[0]
        if self.collision != "off" or self.measure_penetration:
            self._rest_bones.take(
                bones,
                collision=self.collision,
                skin=self.bone_clearance,
                n_max=self.n_voxels,
                n_equal=self.n_voxels_per_axis,
            )

    def _advance(
        self, before: _Frame | None, bones: MovingBones, neighbours: vtkMultiBlockDataSet | None
    ) -> _Frame:
        """Return the frame after another one."""
        started = time.perf_counter()
        if before is None:
            self._take_rest(bones)
        if self.collision != "off" or self.measure_penetration:
            self._rest_bones.check(bones)
        solver = self._made_solver()
        muscle = self._known_muscle
        beside: Sequence[Neighbour] = ()
        if neighbours is not None:
            if self._neighbours is None:
                self._neighbours = Neighbours(muscle.points)
            beside = self._neighbours.at(neighbours)
        last = None if before is None else before.state
        state: Pose | State
        if isinstance(solver, Algorithm2):
            assert not isinstance(last, Pose)
            start = solver.at_rest(len(bones.surfaces)) if last is None else last
            state = solver.step(start, bones.transforms, neighbours=beside, progress=self.report_part)
        else:
            assert not isinstance(last, State)
            state = solver.pose(
                last, bones.transforms, rounds=self.iterations, neighbours=beside, progress=self.report_part
            )
        return _Frame(state, bones.twists, 1e3 * (time.perf_counter() - started))

    def _made_solver(self) -> PathDrivenMuscle | Algorithm2:
        """Return the solver for the present muscle, bones and parameters; it is made where these are new."""
        obstacles = self._rest_bones.obstacles if self.collision != "off" else ()
        muscle, published = self._known_muscle, self.quality == PUBLISHED
        settings = algorithm_2_parameters(self.parameters())
        made_from = muscle, obstacles, settings if published else self.taut_resolution
        if self._solver is None or made_from != self._made_from:
            with errors_at("muscle"):
                self._solver = (
                    Algorithm2(muscle, settings, obstacles)
                    if published
                    else PathDrivenMuscle(muscle, obstacles, self.taut_resolution)
                )
            self._made_from = made_from
        return self._solver

    @property
    def _known_muscle(self) -> FixedMuscle:
        assert self._muscle is not None
        return self._muscle

    # ---------------------------------------------------------------- the result

    def _result(self, muscle: vtkPolyData, frame: _Frame) -> vtkPolyData:
        state = frame.state
        result: vtkPolyData = with_points(muscle, state.surface)
        set_point_array(result, "Displacement", state.surface - self._known_muscle.points)
        if isinstance(state, State):
            set_point_array(result, "Velocity", state.velocities)
        elif state.carried is not None and state.paths is not None:
            set_point_array(result, "Carried", state.carried)
            set_field_array(result, "Unsettled", int(not state.paths.settled))
            if state.fibre_points is not None:
                set_field_array(result, "FibrePoints", state.fibre_points)
                paths = state.paths
                arrays = path_arrays(paths.points, paths.levers(frame.twists), paths.squeezed)
                for name, values in arrays.items():
                    set_field_array(result, name, values)
        for name, value in self._figures(frame).items():
            set_field_array(result, name, value)
        return result

    def _figures(self, frame: _Frame) -> dict[str, float]:
        """Return the field arrays of a frame's report."""
        state = frame.state
        if frame.report is None:
            assert self._solver is not None
            frame.report = self._solver.shape.compare(state.surface)
        depths: Floats | None = None
        if self.measure_penetration:
            free = self._known_muscle.fixed_to < 0
            depths = self._rest_bones.depths(state.surface[free], state.transforms)
        return shape_fields(
            frame.report, colliding=state.colliding, depths=depths, milliseconds=frame.milliseconds
        )
