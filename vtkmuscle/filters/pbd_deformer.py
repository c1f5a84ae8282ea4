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
from vtkmuscle.core.collision.obstacles import Obstacle
from vtkmuscle.core.collision.voxels import DEFAULT_N_MAX
from vtkmuscle.core.pbd.solver import MuscleSolver, MuscleState
from vtkmuscle.core.taut.via_rings import ViaRing
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
from vtkmuscle.data.pipeline_times import times_of
from vtkmuscle.data.superficial import checked_superficial
from vtkmuscle.filters.base.checkpoints import MEGABYTE, Checkpoints
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.base.ports import InputPort, OutputPort
from vtkmuscle.filters.base.time_path import input_at, path_to, request_time, requested_time, state_of_inputs
from vtkmuscle.filters.bone_motion import bones_of
from vtkmuscle.filters.deformer.convergence_report import convergence_fields, convergence_row
from vtkmuscle.filters.deformer.convergence_table import ConvergenceTable
from vtkmuscle.filters.deformer.kept_solver import FixedMuscle
from vtkmuscle.filters.deformer.neighbours import Neighbours
from vtkmuscle.filters.deformer.quality import PRESETS
from vtkmuscle.filters.deformer.solved_muscle import MuscleShape, SolvedMuscle

Ints = NDArray[np.int64]

#: Ports whose data move with time.
BONES, NEIGHBOURS = 1, 3


@dataclass(frozen=True, eq=False)
class _Frame:
    """A state that was computed, and how long that took [ms]."""

    state: MuscleState
    milliseconds: float

    @property
    def nbytes(self) -> int:
        """Memory that it takes [bytes]."""
        return self.state.nbytes


class PBDDeformer(Filter):
    """Deform a muscle with the bones it is fixed to, by position based dynamics.

    Points with a ``FixedTo`` follow their bone. The others keep, as well as they can, the lengths of the
    edges (less so along the fibres, where a muscle gives way), the angles between neighbouring triangles
    and the volume of the muscle, and stay out of the bones.

    With ``anisotropy="taut"``, the default, they also follow the muscle's fibres. Each fibre is a string from
    bone to bone, pulled taut round the bones, from which it keeps away by what of the muscle lies between at
    rest; strings carry the surface along. What edges and angles keep is the muscle carried like that, longer
    or shorter along its fibres, thinner or thicker across; each iteration begins there, and draws the points
    towards it by ``guidance``. So a frame is that of its pose, within what the strings know of the pose
    before. ``"stiffness"`` (published) makes edges the less stiff the more they run along the fibres,
    k = 1 - abs(u . v), keeps the muscle as it is at rest, and pulls no strings.

    The fibres are those connected as ``fibres``; where there are none, lines over the surface stand in for
    them, along the harmonic function between the points fixed to different bones. Where those are fixed to
    one bone only, there are no strings, and all edges are equally stiff. Each edge takes the direction of the
    nearest fibre. A few fibres that somebody has seen on the surface are connected as ``superficial``: how
    they run in comparison with the harmonic function's gradient is spread smoothly over all of the surface.
    For the directions of the edges they count more than ``fibres``, which then are the strings.

    A frame depends on the frames before it. So the frame at time t is computed from rest through all time
    steps that the bones announce up to t, and t itself; steps that are known from earlier requests are not
    computed again, and the frame does not depend on what was asked for before. Bones without time steps
    give one step, from rest to where they are.

    Frames are kept to go back to, in memory of ``checkpoint_memory``; one takes 72 bytes per point, and some
    4.6 kB per string. Where it is used up, every second frame is dropped, then every second of those; a frame
    that was dropped is computed from the nearest kept one before it. Any setting gives the same frames.

    Without strings each step starts from ``"blend"`` or ``"inertial"``. From ``"blend"`` free
    points start where the bones' motions, blended by harmonic weights, take them (they have no momentum
    then). From ``"inertial"`` they start where their velocity takes them (published), and strings do not
    guide them either: the muscle lags behind the bones.

    ``solver="anderson"``, the default, takes the iteration of ``"gauss-seidel"`` nearer to its end in the
    same number of iterations, and stops at ``tolerance``. Stiffnesses hold per iteration then, so that the
    shape it goes to does not depend on their number; with ``"gauss-seidel"`` they hold per step.

    ``quality`` stands for a group of the other parameters, and setting it sets them. Those that are given to
    the constructor beside it count more, and one that is set afterwards is kept until ``quality`` is set
    again. ``"published"`` are the settings of Kohout and Cervenka 2021; the others are points on the curve of
    speed against accuracy.

    ``collision="sdf"`` moves points that are in a bone to its surface, along which they slide. Points that
    are in a bone at rest stay as deep as they are. ``"voxel"`` (published) takes them back the way they came,
    which leaves dents and spikes where a muscle is drawn over a bone. ``bone_push="transform"`` (published)
    then lets points in a bone's outermost voxels stick to it and be drawn into the joint; ``"off"`` leaves
    them where the other constraints have them.

    Muscles connected as ``neighbours`` stay as they are; this one is kept out of them, except as deep as it
    is in them at rest. So muscles are put in an order, in which each yields to those before it:
    ``neighbours={"psoas": psoas, "iliacus": iliacus}``, with their deformers. A point stays on the outer side
    of the plane that touches the neighbour at the place nearest to it; one that a step takes past the middle
    of a neighbour comes out on the other side.

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

    Müller, Heidelberger, Hennix, Ratcliff 2007, *Position based dynamics*,
    doi:10.1016/j.jvcir.2007.01.005.

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

    quality: Parameter[str | None] = Parameter(
        str,
        default=None,
        choices=tuple(PRESETS),
        sets=PRESETS,
        doc="A name for a group of the parameters below, which are set with it: the settings of Kohout and "
        "Cervenka 2021 ('published'), or three on the curve of speed against accuracy; None sets nothing.",
    )
    iterations = Parameter(
        int, default=30, minimum=1, maximum=1_000_000, doc="Projections of all constraints per step, at most."
    )
    substeps = Parameter(
        int,
        default=1,
        minimum=1,
        maximum=10_000,
        doc="Parts that a step is cut into; bones move along their screws.",
    )
    dt = Parameter(float, default=1.0, above=0.0, units="s", doc="Time of a step.")
    velocity_kept = Parameter(
        float,
        default=0.99,
        minimum=0.0,
        maximum=1.0,
        doc="Part of its velocity that a point keeps from step to step.",
    )
    stiffness = Parameter(
        float,
        default=1.0,
        minimum=0.0,
        maximum=1.0,
        doc="Stiffness of the edge lengths, per step (solver 'gauss-seidel') or per iteration ('anderson').",
    )
    shape_stiffness = Parameter(
        float,
        default=0.9,
        minimum=0.0,
        maximum=1.0,
        doc="Stiffness of the angles between triangles, per step (solver 'gauss-seidel') or per iteration.",
    )
    volume_stiffness = Parameter(
        float,
        default=1.0,
        minimum=0.0,
        maximum=1.0,
        doc="Stiffness of the muscle's volume, per step (solver 'gauss-seidel') or per iteration.",
    )
    anisotropy = Parameter(
        str,
        default="taut",
        choices=("taut", "stiffness", "off"),
        doc="How edges give way along the fibres: they follow the fibres, pulled taut round the bones, or "
        "they are less stiff (Kohout and Cervenka 2021), or not at all.",
    )
    guidance = Parameter(
        float,
        default=0.02,
        minimum=0.0,
        maximum=1.0,
        only_with=("anisotropy", "taut"),
        doc="Part of its way to where the taut fibres carry it that each iteration draws a point of the "
        "surface; not with prediction 'inertial'.",
    )
    external_force = Parameter(
        tuple,
        default=(0.0, 0.0, 0.0),
        length=3,
        units="mm/s^2",
        doc="Force per mass on all free points; for prediction 'inertial'. With another one the solve leads "
        "to where the constraints are met, and leaves the less of the force the further it goes.",
    )
    collision = Parameter(
        str,
        default="sdf",
        choices=("sdf", "voxel", "off"),
        doc="How points are kept out of the bones: by signed distances, by voxels (published) or not at all.",
    )
    grid_spacing: Parameter[float | None] = Parameter(
        float,
        default=None,
        above=0.0,
        units="mm",
        only_with=("collision", "sdf"),
        doc="Distance of the nodes of the signed distance grids; None is 1/600 of the diagonal of the bone's "
        "box along its principal axes.",
    )
    bone_clearance = Parameter(
        float,
        default=0.0,
        minimum=0.0,
        units="mm",
        only_with=("collision", "sdf"),
        doc="Distance that points keep from the bones; those nearer at rest may come as near.",
    )
    friction = Parameter(
        float,
        default=0.0,
        minimum=0.0,
        only_with=("collision", "sdf"),
        doc="Coulomb's coefficient between muscle and bones: how much of the push out of a bone may be spent "
        "on holding a point where it is on the bone.",
    )
    n_voxels = Parameter(
        int,
        default=DEFAULT_N_MAX,
        minimum=1,
        only_with=("collision", "voxel"),
        doc="Number of voxels of a bone, about, shared out by the sides of its box so that they are nearly "
        "cubes.",
    )
    n_voxels_per_axis: Parameter[int | None] = Parameter(
        int,
        default=None,
        minimum=1,
        only_with=("collision", "voxel"),
        doc="Number of voxels along each axis of a bone's box, instead of n_voxels.",
    )
    bone_push = Parameter(
        str,
        default="off",
        choices=("transform", "off"),
        only_with=("collision", "voxel"),
        doc="What a bone does to points that it moved over: take them with it, or nothing.",
    )
    contact_velocity = Parameter(
        str,
        default="zero",
        choices=("zero", "keep"),
        doc="Velocity of points that met a bone: none, as Kohout and Cervenka 2021 propose, or that of "
        "their displacement, as they compute it.",
    )
    prediction = Parameter(
        str,
        default="blend",
        choices=("inertial", "blend"),
        doc="Where free points start each step: where their velocity takes them (published), or where the "
        "bones' blended motions do.",
    )
    solver = Parameter(
        str,
        default="anderson",
        choices=("gauss-seidel", "anderson"),
        doc="The iteration: as it is (published), or accelerated towards the same shape.",
    )
    tolerance = Parameter(
        float,
        default=0.5,
        minimum=0.0,
        units="mm",
        only_with=("solver", "anderson"),
        doc="Stop at this distance to the converged shape (root mean square), a bound of it where points are "
        "drawn to taut fibres, else an estimate. 0 never stops.",
    )
    projection_order = Parameter(
        str,
        default="batched",
        choices=("batched", "sequential"),
        doc="Order of projections: edges many at once and the volume last, or all one by one "
        "and the volume before angles and bones (published), which keeps it less well.",
    )
    measure_penetration = Parameter(
        bool,
        default=False,
        doc="Measure how deep points are in the bones, against their triangles, for each frame asked for.",
    )
    checkpoint_memory = Parameter(
        float,
        default=256.0,
        minimum=0.0,
        units="MB",
        doc="Memory for frames kept to go back in time; the last two are kept even with 0.",
    )

    verbose = Parameter(
        bool,
        default=False,
        doc="Print the convergence report of each frame, a row as it is done, on standard error.",
    )
    dtype = Parameter(
        str,
        default="float64",
        choices=("float64", "float32"),
        doc="Numbers that the iteration computes with; 'float32' only with solver 'gauss-seidel' and "
        "projection_order 'batched'.",
    )
    threads = Parameter(
        int,
        default=0,
        minimum=0,
        doc="Threads that work on a muscle of more than 65 536 edges, 0 for as many as there are processors; "
        "a smaller one is left to one. The result is the same bit for bit.",
    )

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
        doc="The muscle at the time asked for, with the arrays of the input and the point arrays "
        "``Displacement`` (3) from rest [mm] and ``Velocity`` (3) [mm/s], and the field arrays "
        "``VolumeRatio`` (V / V0), ``EdgeStretchP50``, ``EdgeStretchP95`` and ``EdgeStretchMax`` (l / l0 of "
        "all edges), ``AlongFibresP5``, ``AlongFibresP50`` and ``AlongFibresP95`` (within 18 degrees "
        "of the fibres), ``AcrossFibresP5``, ``AcrossFibresP50`` and ``AcrossFibresP95`` (over 72 degrees; "
        "both where ``anisotropy`` is not 'off'), ``DihedralErrorP50`` and ``DihedralErrorP95`` [degrees], "
        "``DegenerateEdges`` (whose angle was lost as a triangle collapsed), ``Iterations``, "
        "``Residual`` (root mean square of what the "
        "last iteration moved points by) [mm], ``EstimatedDistance`` to the converged shape, with solver "
        "'anderson' [mm] (within a factor of 2 in two cases of three where no bone is met; unknown where one "
        "is), ``CollidingPoints``, ``Milliseconds`` (of the last step) and, within it, "
        "``MillisecondsPrediction``, ``MillisecondsConstraints``, ``MillisecondsCollision``, "
        "``MillisecondsAcceleration`` and ``MillisecondsSettling``; with ``measure_penetration`` "
        "``PenetrationMax`` and ``PenetrationP95`` [mm], how deep the free points are in the closed bones (0 "
        "outside), and ``PenetratingPoints``, how many are inside. With ``anisotropy`` 'taut' the point "
        "array ``Carried`` (3), where the taut fibres carry each point before edges, volume and bones are "
        "heeded [mm], the field array ``FibrePoints`` (p, 3), where they carry the points of "
        "``fibres`` [mm], and ``UnsettledFibres``, how many fibres did not come to rest.",
    )

    def __init__(self, **settings: Any) -> None:
        self._muscle = SolvedMuscle("PBDDeformer: muscle")
        self._rest_bones = RestBones("PBDDeformer: bones")
        self._neighbours: Neighbours | None = None
        self._rest_from: float | None = None
        self._frames: Checkpoints[_Frame] = Checkpoints()
        self._made_with: object = None
        self._steps: tuple[float, ...] = ()
        self._table: ConvergenceTable | None = None
        super().__init__(**settings)

    # ---------------------------------------------------------------- time

    def time_steps(self, inputs_information: Sequence[Any]) -> Sequence[float] | None:
        """Return the time steps that the bones announce."""
        return times_of(inputs_information[BONES]) or None

    def RequestUpdateExtent(self, request: Any, inInfo: Any, outInfo: Any) -> int:
        """Ask for the bones at the first time whose frame is not known yet.

        The later ones are asked for in :meth:`execute`. VTK's own way, CONTINUE_EXECUTING, is no choice: when
        a filter upstream fails on the way, VTK goes round for ever.
        """
        self._forget_if_changed()
        bones = inInfo[BONES].GetInformationObject(0)
        self._steps = times_of(bones)
        if self._steps:
            self.request_time = requested_time(outInfo.GetInformationObject(0))
            path = path_to(self.request_time, self._steps)
            missing = path[self._frames.done(path) :]
            for port in self._moving_ports():
                request_time(inInfo[port].GetInformationObject(0), (missing or path[-1:])[0])
        return 1

    def _moving_ports(self) -> tuple[int, ...]:
        """Return the connected ports whose data move with time."""
        return (BONES, NEIGHBOURS) if self.GetNumberOfInputConnections(NEIGHBOURS) else (BONES,)

    def _input_at(self, port: int, time: float | None) -> vtkMultiBlockDataSet:
        data: vtkMultiBlockDataSet | None = input_at(self, port, time)
        if data is None:
            name = self.input_ports[port].name
            raise RuntimeError(f"PBDDeformer: the {name} at time {time:g} could not be computed")
        return data

    def _forget_if_changed(self) -> None:
        """Drop all frames when a parameter they depend on or anything upstream of the bones has changed."""
        made_with = self._settings_of_frames(), state_of_inputs(self, self._moving_ports())
        if made_with != self._made_with:
            self._frames.clear()
            self._made_with = made_with
            self._neighbours = None

    def _settings_of_frames(self) -> dict[str, Any]:
        """Return the parameters that a frame depends on."""
        settings = self.parameters_that_count()
        del settings["quality"], settings["checkpoint_memory"], settings["verbose"]
        if self.collision != "off":  # the bones at rest are known then
            del settings["measure_penetration"]
        return settings

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
        if not self._steps:
            self._frames.clear()
        path = path_to(self.request_time, self._steps)
        known = self._frames.done(path)
        if known and self._rest_from != path[0]:
            self._take_rest(path[0], bones_of(self._input_at(BONES, path[0]), "PBDDeformer: bones"))
        for index in range(known, len(path)):
            at = path[index]
            now, beside = bones, neighbours
            if at is not None and self._steps:
                now = self._input_at(BONES, at)
                if beside is not None:
                    beside = self._input_at(NEIGHBOURS, at)
            self._advance(path, index, bones_of(now, "PBDDeformer: bones"), beside)
        self._thin_out(path)
        return self._result(muscle, self._frames[path[-1]])

    def _thin_out(self, path: Sequence[float | None]) -> None:
        """Drop frames for which there is no room; the last two of a path stay, to go on from."""
        nbytes = self._frames[path[-1]].nbytes
        memory = MEGABYTE * self.checkpoint_memory
        self._frames.thin(self._steps, path[-2:], nbytes=nbytes, memory=memory)

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
            lines = polylines_of(fibres, "PBDDeformer: fibres")
        if superficial is not None and self.anisotropy != "off":
            seen = checked_superficial(superficial, "PBDDeformer: superficial")
        if self._muscle.take(FixedMuscle(points, triangles, fixed_to, lines, seen, rings)):
            self._frames.clear()
            self._neighbours = None

    def _checked_fixed_to(self, array: NDArray[Any], names: list[str]) -> Ints:
        where = "PBDDeformer: muscle, point array 'FixedTo'"
        if array.ndim != 1 or not np.isfinite(array).all() or (array != np.floor(array)).any():
            raise ValueError(f"{where}: expected one whole number per point (FixedPointDetector makes it)")
        fixed_to = array.astype(np.int64)
        bad = fixed_to[(fixed_to < -1) | (fixed_to >= len(names))]
        if len(bad):
            raise ValueError(
                f"{where}: {bad[0]} is neither -1 (free) nor the index of one of the {len(names)} bones "
                f"({', '.join(map(repr, names))}); detect the fixed points with these bones"
            )
        if (fixed_to < 0).all() and not any(self.external_force):
            raise ValueError(
                f"{where}: no point is fixed to a bone and external_force is zero, so nothing would hold or "
                "move the muscle; detect fixed points by another method or tolerance"
            )
        return fixed_to

    def _take_rest(self, first: float | None, bones: dict[str, vtkPolyData]) -> None:
        """Take the bones at rest from the first frame of a path, on which their last digits depend."""
        self._rest_from = first
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
        self,
        path: Sequence[float | None],
        known: int,
        bones: dict[str, vtkPolyData],
        neighbours: vtkMultiBlockDataSet | None,
    ) -> None:
        """Compute the frame after the known ones of a path."""
        started = time.perf_counter()
        if known == 0:
            self._take_rest(path[0], bones)
        transforms = transforms_of(bones, "PBDDeformer: bones")
        solver = self._made_solver()
        if self.collision != "off" or self.measure_penetration:
            self._rest_bones.check(bones, transforms)
        before = self._frames[path[known - 1]].state if known else solver.rest_state(len(bones))
        beside: Sequence[Neighbour] = ()
        if neighbours is not None:
            if self._neighbours is None:
                rest = solver.points(solver.rest_state(len(bones)))
                self._neighbours = Neighbours("PBDDeformer: neighbours", rest)
            beside = self._neighbours.at(neighbours)
        state = solver.step(
            before,
            transforms,
            neighbours=beside,
            progress=lambda part: self.report_progress((known + part) / len(path)),
        )
        frame = _Frame(state, 1e3 * (time.perf_counter() - started))
        self._frames.keep(path[known], frame)
        if self.verbose:
            self._tell(path[known], frame)
        self._thin_out(path[: known + 1])

    def _tell(self, at: float | None, frame: _Frame) -> None:
        """Print a row of figures."""
        if self._table is None:
            self._table = ConvergenceTable()
        self._table.add("" if at is None else f"{at:g}", convergence_row(self._convergence(frame)))

    def _made_solver(self) -> MuscleSolver:
        """Return the solver for the present parameters."""
        return self._muscle.solver(self.parameters(), self._obstacles())

    def _obstacles(self) -> tuple[Obstacle, ...]:
        return self._rest_bones.obstacles if self.collision != "off" else ()

    # ---------------------------------------------------------------- the result

    def _result(self, muscle: vtkPolyData, frame: _Frame) -> vtkPolyData:
        shape = self._shape_of(frame)
        result: vtkPolyData = with_points(muscle, shape.points)
        set_point_array(result, "Displacement", shape.displacement)
        set_point_array(result, "Velocity", shape.velocities)
        for name, value in self._convergence(frame).items():
            set_field_array(result, name, value)
        carried = self._muscle.carried(frame.state, self.parameters(), self._obstacles())
        if carried is not None:
            surface, fibre_points = carried
            set_point_array(result, "Carried", surface)
            if fibre_points is not None:
                set_field_array(result, "FibrePoints", fibre_points)
            unsettled = frame.state.guided.state.unsettled if frame.state.guided is not None else 0
            set_field_array(result, "UnsettledFibres", unsettled)
        return result

    def _shape_of(self, frame: _Frame) -> MuscleShape:
        return self._muscle.shape(frame.state, self.parameters(), self._obstacles())

    def _convergence(self, frame: _Frame) -> dict[str, float]:
        """Return the field arrays of a frame's convergence report."""
        shape, depths = self._shape_of(frame), None
        if self.measure_penetration:
            depths = self._rest_bones.depths(shape.points[self._muscle.free], frame.state.transforms)
        return convergence_fields(shape.report, frame.state, depths=depths, milliseconds=frame.milliseconds)
