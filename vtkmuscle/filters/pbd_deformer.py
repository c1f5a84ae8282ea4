"""PBDDeformer: a muscle that follows its bones."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.collision.muscle_contact import Neighbour
from vtkmuscle.core.errors import InputError, placed
from vtkmuscle.core.pbd.muscle_model import FixedMuscle, MuscleModel, MuscleShape
from vtkmuscle.core.pbd.solver import MuscleSolver
from vtkmuscle.core.pbd.state import MuscleState
from vtkmuscle.core.taut.via_rings import ViaRing
from vtkmuscle.core.types import Ints
from vtkmuscle.data.arrays import (
    blocks_of,
    checked_surface,
    point_array,
    polylines_of,
    set_field_array,
    set_point_array,
    with_points,
)
from vtkmuscle.data.attachments import rings_by_bone
from vtkmuscle.data.moving_bones import RestBones, transforms_of
from vtkmuscle.data.paths import path_arrays
from vtkmuscle.data.superficial import checked_superficial
from vtkmuscle.filters.base.history import HistoryFilter
from vtkmuscle.filters.base.ports import InputPort, OutputPort
from vtkmuscle.filters.bone_motion import bones_of
from vtkmuscle.filters.deformer.convergence_report import convergence_fields
from vtkmuscle.filters.deformer.neighbours import Neighbours
from vtkmuscle.filters.deformer.settings import DeformerSettings, solver_parameters


@dataclass(frozen=True, eq=False)
class _Frame:
    """A state that was computed, and how long that took [ms]."""

    state: MuscleState
    milliseconds: float

    @property
    def nbytes(self) -> int:
        """Memory that it takes [bytes]."""
        return self.state.nbytes


class PBDDeformer(DeformerSettings, HistoryFilter[_Frame]):
    """Deform a muscle with the bones it is fixed to, by position based dynamics.

    Points with a ``FixedTo`` follow their bone. The others keep, as well as they can, the lengths of the
    edges, the angles between neighbouring triangles and the volume of the muscle, and stay out of the bones.

    With ``anisotropy="taut"``, the default, they also follow the muscle's fibres. Each fibre is a string from
    bone to bone, pulled taut round the bones, from which it keeps away by what of the muscle lies between at
    rest. The strings carry the surface; edges and angles keep the muscle as it is carried, and each iteration
    draws the points towards it by ``guidance``. ``"stiffness"`` (Kohout and Cervenka 2021) makes edges the
    less stiff the more they run along the fibres, k = 1 - abs(u . v), and pulls no strings.

    The fibres are those connected as ``fibres``; where there are none, lines over the surface stand in for
    them, along the harmonic function between the points fixed to different bones. Where those are fixed to
    one bone only, there are no strings, and all edges are equally stiff. Fibres seen on the surface,
    connected as ``superficial``, count more for the directions of the edges.

    A frame depends on the frames before it: the frame at time t is computed from rest through all time steps
    that the bones announce up to t, and t itself, whatever was asked for before. Frames are kept to go back
    to, in memory of ``checkpoint_memory``; one takes 72 bytes per point, and some 4.6 kB per string. Where it
    is used up, every second frame is dropped, then every second of those.

    Without strings each step starts from ``"blend"``, where the bones' motions, blended by harmonic weights,
    take the free points, or from ``"inertial"``, where their velocity takes them; strings do not draw them
    then, and the muscle hangs back behind the bones. ``solver="anderson"``, the default, takes the iteration
    of ``"gauss-seidel"`` nearer to its end in the same number of iterations, and stops at ``tolerance``.

    ``collision="sdf"`` moves points that are in a bone to its surface, along which they slide. Points that
    are in a bone at rest stay as deep as they are. ``"voxel"`` takes them back the way they came, which
    leaves dents and spikes where a muscle is drawn over a bone.

    Muscles connected as ``neighbours`` stay as they are; this one is kept out of them, except as deep as it
    is in them at rest: ``neighbours={"psoas": psoas, "iliacus": iliacus}``, with their deformers.

    ``quality`` stands for a group of the other parameters, and setting it sets them. Those that are given to
    the constructor beside it count more, and one that is set afterwards is kept until ``quality`` is set
    again. ``"published"`` are the settings of Kohout and Cervenka 2021; the others are points on the curve of
    speed against accuracy.

    Raises
    ------
    ValueError
        If the surface is open, is not made of triangles or encloses no volume; if a coordinate is not
        finite; if ``FixedTo`` is missing or names a block that does not exist; if no point is fixed while
        there is no external force (nothing would hold or move the muscle); if a bone has no ``Transform``,
        one that is not rigid, or points that did not move with it.

    References
    ----------
    Kohout, Cervenka 2021, *Muscle Deformation Using Position Based Dynamics*,
    doi:10.1007/978-3-030-72379-8_24.

    Müller et al. 2007, *Position based dynamics*, doi:10.1016/j.jvcir.2007.01.005.

    Examples
    --------
    >>> from vtkmuscle.filters import BoneMotion, FixedPointDetector, PBDDeformer
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> fixed = FixedPointDetector()(muscle, phantom.bones, phantom.attachments[name])
    >>> moving = BoneMotion(bones=phantom.bones, motion=phantom.motion)
    >>> deformed = PBDDeformer(muscle=fixed, bones=moving, iterations=5).apply(time=10.0)
    >>> bool(abs(deformed.field_data["VolumeRatio"][0] - 1.0) < 0.01)
    True
    """

    muscle = InputPort(
        vtkPolyData,
        doc="Closed triangles in the rest pose, with the point array ``FixedTo``: -1 for a free point, else "
        "the index of a bone's block.",
    )
    bones = InputPort(
        vtkMultiBlockDataSet,
        doc="Bones at the pipeline's time, each with the field array ``Transform`` (16, row major): rest to "
        "now. Where one has the field array ``Reach``, points (n, 3) in the rest pose, its signed distance "
        "grid covers the part between them; a muscle that leaves it gets the whole bone, with a warning.",
    )
    fibres = InputPort(vtkPolyData, optional=True, doc="Polylines in the rest pose, for the anisotropy.")
    neighbours = InputPort(
        vtkMultiBlockDataSet,
        optional=True,
        doc="Other muscles at the pipeline's time, out of which this one is kept: outputs of PBDDeformer, "
        "with the point array ``Displacement``.",
    )
    superficial = InputPort(
        vtkPolyData,
        optional=True,
        doc="Polylines on the muscle's surface in the rest pose, or near it; a few suffice for the direction "
        "of the anisotropy.",
    )
    attachments = InputPort(
        vtkMultiBlockDataSet,
        optional=True,
        doc="For the via rings among them, which the fibres pass through.",
    )
    output = OutputPort(
        vtkPolyData,
        doc="The muscle at the time asked for, with the arrays of the input; the point arrays "
        "``Displacement`` (3) from rest [mm] and ``Velocity`` (3) [mm/s]; the field arrays "
        "``VolumeRatio`` (V / V0), ``EdgeStretchP50``, ``EdgeStretchP95`` and ``EdgeStretchMax`` (l / l0), "
        "``AlongFibresP5``, ``AlongFibresP50`` and ``AlongFibresP95`` (of the edges within 18 degrees of the "
        "fibres), ``AcrossFibresP5``, ``AcrossFibresP50`` and ``AcrossFibresP95`` (over 72 degrees), "
        "``DihedralErrorP50`` and ``DihedralErrorP95`` [degrees], ``DegenerateEdges`` (whose angle was lost "
        "as a triangle collapsed), ``Iterations``, ``Residual`` (root mean square of what the last one moved "
        "points by) [mm], ``EstimatedDistance``, a bound of the distance to the converged shape, where taut "
        "fibres draw the points [mm], ``CollidingPoints``, ``Milliseconds`` (of the last step) and of it "
        "``MillisecondsPrediction``, ``MillisecondsConstraints``, ``MillisecondsCollision``, "
        "``MillisecondsAcceleration`` and ``MillisecondsSettling``. With ``measure_penetration`` also "
        "``PenetrationMax`` and ``PenetrationP95`` [mm], how deep the free points are in the closed bones, "
        "and ``PenetratingPoints``, how many. With ``anisotropy`` 'taut' also the point array ``Carried`` "
        "(3), where the taut fibres carry each point before edges, volume and bones are heeded [mm], and the "
        "field arrays ``FibrePoints`` (p, 3), where they carry the points of ``fibres`` [mm], and "
        "``UnsettledFibres``, how many fibres did not come to rest; and of the taut fibres, where each "
        "stands for one of ``fibres``, ``PathLength`` (k,) [mm], ``PathPoints`` (k, 3 n) [mm] and "
        "``PathWrench_BONE`` (k, 6), force [1] and moment about the origin [mm] that one of unit tension "
        "exerts on each bone.",
    )

    moving = ("bones", "neighbours")

    def __init__(self, **settings: Any) -> None:
        self._model: MuscleModel | None = None
        self._rest_bones = RestBones("PBDDeformer: bones")
        self._neighbours: Neighbours | None = None
        self._rest_from: float | None = None
        super().__init__(**settings)

    def settings_of_frames(self) -> dict[str, Any]:
        """Return the parameters that a frame depends on."""
        settings = super().settings_of_frames()
        del settings["quality"]
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
        muscle: vtkPolyData,
        bones: vtkMultiBlockDataSet,
        fibres: vtkPolyData | None,
        neighbours: vtkMultiBlockDataSet | None,
        superficial: vtkPolyData | None,
        attachments: vtkMultiBlockDataSet | None,
    ) -> vtkPolyData:
        """Compute the frames on the way to the time asked for that are not known, and return the last."""
        names = [name for name, _ in blocks_of(bones)]
        rings = rings_by_bone(attachments, names, "PBDDeformer: attachments")
        self._prepare(muscle, fibres, superficial, names, rings)
        first = self.path[0]
        if self._frames.done(self.path) and self._rest_from != first:
            self._take_rest(bones_of(self.data_at("bones", bones, first), "PBDDeformer: bones"))
        return self._result(muscle, self.frame((bones, neighbours), self._advance), names)

    def _prepare(
        self,
        muscle: vtkPolyData,
        fibres: vtkPolyData | None,
        superficial: vtkPolyData | None,
        bones: list[str],
        rings: tuple[tuple[int, ViaRing], ...],
    ) -> None:
        where = "PBDDeformer: muscle"
        points, triangles = checked_surface(muscle, where)
        fixed_to = self._checked_fixed_to(point_array(muscle, "FixedTo", where), bones)
        lines = seen = None
        if fibres is not None and self.anisotropy != "off":
            found = polylines_of(fibres, "PBDDeformer: fibres")
            lines = found.points, found.offsets
        if superficial is not None and self.anisotropy != "off":
            found = checked_superficial(superficial, "PBDDeformer: superficial")
            seen = found.points, found.offsets
        given = FixedMuscle(points, triangles, fixed_to, lines, seen, rings)
        if self._model is None or not given.same_as(self._model.muscle):
            self._model = MuscleModel(given)
            self.forget()

    def _checked_fixed_to(self, array: NDArray[Any], names: list[str]) -> Ints:
        where = "PBDDeformer: muscle, point array 'FixedTo'"
        if array.ndim != 1 or not np.isfinite(array).all() or (array != np.floor(array)).any():
            raise InputError(where, "it must be one whole number per point", "FixedPointDetector makes it")
        fixed_to = array.astype(np.int64)
        bad = fixed_to[(fixed_to < -1) | (fixed_to >= len(names))]
        if len(bad):
            raise InputError(
                where,
                f"{bad[0]} is neither -1 (free) nor the index of one of the {len(names)} bones "
                f"({', '.join(map(repr, names))})",
                "detect the fixed points with these bones",
            )
        if (fixed_to < 0).all() and not any(self.external_force):
            raise InputError(
                where,
                "no point is fixed to a bone and external_force is zero, so nothing would hold or move the "
                "muscle",
                "detect fixed points by another method or distance",
            )
        return fixed_to

    def _take_rest(self, bones: dict[str, vtkPolyData]) -> None:
        """Take the bones at rest from the first frame of the path, on which their last digits depend."""
        self._rest_from = self.path[0]
        if self.collision != "off" or self.measure_penetration:
            transforms = transforms_of(bones, "PBDDeformer: bones")
            self._rest_bones.take(
                bones,
                transforms,
                collision=self.collision,
                cell=self.grid_spacing,
                skin=self.bone_clearance,
                friction=self.friction,
                n_max=self.n_voxels,
                n_equal=self.n_voxels_per_axis,
            )

    def _advance(
        self, before: _Frame | None, bones_now: vtkMultiBlockDataSet, neighbours: vtkMultiBlockDataSet | None
    ) -> _Frame:
        """Return the frame after another one."""
        started = time.perf_counter()
        bones = bones_of(bones_now, "PBDDeformer: bones")
        if before is None:
            self._take_rest(bones)
        transforms = transforms_of(bones, "PBDDeformer: bones")
        solver = self._made_solver()
        if self.collision != "off" or self.measure_penetration:
            self._rest_bones.check(bones, transforms)
        start = solver.rest_state(len(bones)) if before is None else before.state
        beside: Sequence[Neighbour] = ()
        if neighbours is not None:
            if self._neighbours is None:
                rest = solver.points(solver.rest_state(len(bones)))
                self._neighbours = Neighbours("PBDDeformer: neighbours", rest)
            beside = self._neighbours.at(neighbours)
        state = solver.step(start, transforms, neighbours=beside, progress=self.report_part)
        return _Frame(state, 1e3 * (time.perf_counter() - started))

    def _made_solver(self) -> MuscleSolver:
        """Return the solver for the present parameters."""
        obstacles = self._rest_bones.obstacles if self.collision != "off" else ()
        with placed("PBDDeformer: muscle"):
            return self._known_model.solver(
                solver_parameters(self.parameters()), self.anisotropy, obstacles, self.taut_resolution
            )

    @property
    def _known_model(self) -> MuscleModel:
        assert self._model is not None
        return self._model

    # ---------------------------------------------------------------- the result

    def _result(self, muscle: vtkPolyData, frame: _Frame, bones: list[str]) -> vtkPolyData:
        shape = self._known_model.shape(frame.state)
        result: vtkPolyData = with_points(muscle, shape.points)
        set_point_array(result, "Displacement", shape.displacement)
        set_point_array(result, "Velocity", shape.velocities)
        for name, value in self._convergence(frame, shape).items():
            set_field_array(result, name, value)
        if shape.carried is not None and frame.state.guided is not None:
            set_point_array(result, "Carried", shape.carried)
            set_field_array(result, "UnsettledFibres", frame.state.guided.state.unsettled)
        if shape.fibre_points is not None and frame.state.guided is not None:
            set_field_array(result, "FibrePoints", shape.fibre_points)
            paths = frame.state.guided.state
            for name, values in path_arrays(paths.points, paths.wrenches, bones).items():
                set_field_array(result, name, values)
        return result

    def _convergence(self, frame: _Frame, shape: MuscleShape) -> dict[str, float]:
        """Return the field arrays of a frame's convergence report."""
        depths = None
        if self.measure_penetration:
            free = self._known_model.muscle.fixed_to < 0
            depths = self._rest_bones.depths(shape.points[free], frame.state.transforms)
        return convergence_fields(shape.report, frame.state, depths=depths, milliseconds=frame.milliseconds)
