"""PBDDeformer: position based dynamics of a muscle's surface."""

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.errors import InputError, errors_at
from vtkmuscle.core.fixed_muscle import FixedMuscle
from vtkmuscle.core.mesh.surface import longest_side, survey, used_alone
from vtkmuscle.core.pbd.levels import FINE_ITERATIONS, TwoLevels, coarse_fixed_points
from vtkmuscle.core.pbd.solver import Parameters, PBDSolver, State
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import Polylines, add_arrays
from vtkmuscle.data.label_images import decimated
from vtkmuscle.data.moving_bones import MovingBones, RestBones, fixed_muscle
from vtkmuscle.data.muscle_geometry import Neighbours, Surface
from vtkmuscle.filters.base import HistoryFilter, InputPort, OutputPort, ports
from vtkmuscle.filters.deformer import DeformerSettings, deformed_muscle


class PBDDeformer(DeformerSettings, HistoryFilter[State]):
    """Deform a muscle with its bones by position based dynamics.

    Edge lengths, angles between triangles and the volume are constraints, projected in turn in each
    iteration; edges along the fibres are soft, and points stay out of the bones (Kohout and Cervenka 2021).
    Fixed points follow their bone. A frame starts where the bones' motions since the last frame take the
    muscle, straight or round bones, and ends with the exact volume; ``quality="published"`` is the algorithm
    as printed. A surface of more than ``solved_triangles`` is solved on two levels: a decimated surface moves
    the fine surface, which takes a few further iterations.

    A frame depends on all announced time steps before. Stored frames take 24 to 96 bytes per point and 128
    per bone; beyond ``checkpoint_memory`` every second frame is dropped. With a ``start`` a frame depends on
    its pose alone, edges keep the lengths of the start, and all triangles are solved.

    ``collision="sdf"`` moves points out of a bone to the surface, where points slide; points inside at rest
    keep their depth. ``"voxel"`` moves points back on their way, as published, which leaves dents and spikes.

    Parameters
    ----------
    muscle
        Closed triangles in the rest pose, with the point array ``FixedTo``: -1 for a free point, else the
        index of a bone's block.
    rest_bones
        Bones in the rest pose.
    bones
        The same bones at the pipeline's time, each with the field array ``Transform`` (16, row major): rest
        to now.
    fibres
        Polylines in the rest pose; edges along fibres are soft.
    start
        The muscle's points at the pipeline's time, such as from PathDeformer: the start of each frame.
    neighbours
        Other muscles at the pipeline's time, from deformers, with the point array ``Displacement``. The
        muscle is no deeper in a neighbour than at rest; neighbours do not move.

    Attributes
    ----------
    output
        The muscle at the requested time, with the arrays of the input, and the point arrays ``Displacement``
        (3) from rest [mm] and, with velocities on a single level, ``Velocity`` (3) [mm/s]. With
        ``measure_shape`` the field arrays ``VolumeRatio`` (V / V0), ``EdgeStretchP95`` and
        ``EdgeStretchMax`` (l / l0), ``DihedralErrorP95`` [degrees], ``DegenerateEdges`` (at collapsed
        triangles) and ``CollidingPoints``; with ``measure_penetration`` ``PenetrationMax`` and
        ``PenetrationP95``, depths of free points in closed bones [mm], and ``PenetratingPoints``.

    Raises
    ------
    ValueError
        If the surface is open, is not made of triangles or encloses no volume; if a coordinate is not
        finite; if ``FixedTo`` is missing or names a missing block; if no point is fixed, without an external
        force; if a bone has no ``Transform``, or is not rigid; if the bones at rest have other names; if
        ``start`` has another number of points.

    References
    ----------
    Kohout, Cervenka 2021, *Muscle Deformation Using Position Based Dynamics*,
    doi:10.1007/978-3-030-72379-8_24; Müller, Heidelberger, Hennix, Ratcliff 2007, *Position based dynamics*,
    doi:10.1016/j.jvcir.2007.01.005.

    Limitations
    -----------
    An iteration does not converge: shape and moment arms depend on the numbers of iterations and triangles,
    by up to 20 mm. Edges resist shortening: a muscle whose ends come near each other bows aside, and may bow
    round a bone. A bone does not sweep a muscle wholly between two frames. A muscle may intersect itself.

    Examples
    --------
    >>> from vtkmuscle.filters import BoneMotion, FixedPointDetector, PBDDeformer
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> fixed = FixedPointDetector()(muscle, phantom.bones, phantom.attachments[name])
    >>> moving = BoneMotion(bones=phantom.bones, motion=phantom.motion)
    >>> deformer = PBDDeformer(muscle=fixed, rest_bones=phantom.bones, bones=moving, measure_shape=True)
    >>> bool(abs(deformer.apply(time=10.0).field_data["VolumeRatio"][0] - 1.0) < 1e-9)
    True
    """

    muscle = ports.RestSurface()
    rest_bones = ports.RestBones()
    bones = ports.MovingBones()
    fibres = ports.Lines(optional=True)
    start = ports.Surface(optional=True)
    neighbours = InputPort(vtkMultiBlockDataSet, optional=True)
    output = OutputPort(vtkPolyData)

    moving = ("bones", "start", "neighbours")
    without_effect = ("checkpoint_memory", "measure_shape", "measure_penetration")

    @property
    def path(self) -> list[float | None]:
        """Times of the frames up to the requested time; the requested time alone with a start."""
        return [self.request_time] if self.start is not None else super().path

    def execute(
        self, muscle: Surface, rest_bones: RestBones, bones: MovingBones, fibres: Polylines | None,
        start: Surface | None, neighbours: vtkMultiBlockDataSet | None,
    ) -> vtkPolyData:  # fmt: skip
        """Return the muscle at the requested time."""
        driven = self.prediction == "velocity" and any(self.external_force)
        rest = fixed_muscle(muscle, list(bones.surfaces), fibres, driven=driven)
        rest_bones.check_same(bones)
        measured, collides = (self.measure_shape, self.measure_penetration), self.collision != "off"
        shapes = rest_bones.shapes if collides or self.measure_penetration else {}
        voxels = (self.n_voxels, self.n_voxels_per_axis) if self.collision == "voxel" else None
        more = shapes if collides else {}, self.bone_clearance if voxels is None else 0.0, voxels
        one_level = self.start is not None or not 0 < self.solved_triangles < len(rest.triangles)
        count, settings = 0 if one_level else self.solved_triangles, self.parameters_that_count().items()
        of_solver = {name: x for name, x in settings if name in Parameters.__dataclass_fields__}
        with errors_at("muscle"):
            solver, levels = self.once("solver", (rest, Parameters(**of_solver), more, count), self._made)
        # The neighbours' shapes at rest belong to the inputs.
        near_now = self.once("neighbours", (self._made_with, *levels), lambda _, *rests: Neighbours(*rests))

        def advance(before: State | None, bones: MovingBones, start: Surface | None, near: Any) -> State:
            """Return the state after another one."""
            options: dict[str, Any] = {"near": near_now.at(near), "report": self.report_part}
            if start is None:
                last = solver.at_rest(len(bones.surfaces)) if before is None else before
                return solver.step(last, bones.transforms, **options)
            assert isinstance(solver, PBDSolver)
            if len(start.points) != len(rest.points):
                problem = f"it has {len(start.points)} points, but the muscle {len(rest.points)}"
                raise InputError("start", problem, "connect a filter that moves this muscle")
            return solver.pose(start.points, bones.transforms, **options)

        state = self.frame((bones, start, neighbours), advance)
        moved = ((bone, state.transforms[number]) for number, bone in shapes.items())
        result = deformed_muscle(muscle.data, rest, state, solver.shape, moved, measured)
        if state.velocities is not None and len(state.velocities) == len(state.surface):
            add_arrays(result, points={"Velocity": state.velocities})
        return result

    def _made(
        self, muscle: FixedMuscle, settings: Parameters, more: tuple[Any, ...], count: int
    ) -> tuple[PBDSolver | TwoLevels, list[Floats]]:
        """Return the solver, and points at rest by level, after a change of muscle, bones or parameters."""
        self._frames.clear()
        coarse = _coarser(muscle, count) if count else None
        if coarse is None:
            return PBDSolver(muscle, settings, *more), [muscle.points]
        fine = PBDSolver(muscle, replace(settings, iterations=FINE_ITERATIONS), *more)
        solver = TwoLevels(PBDSolver(coarse, settings, *more), fine, muscle.fixed_to)
        return solver, [coarse.points, muscle.points]


def _coarser(muscle: FixedMuscle, count: int) -> FixedMuscle | None:
    """Return a muscle of about `count` triangles; None, with a warning, if decimation tears the surface."""
    fine, corners = used_alone(muscle.points, muscle.triangles)
    middle, size = fine.mean(axis=0), longest_side(fine)
    points, triangles = decimated((fine - middle) / size, corners, count)
    points = points * size + middle
    report = survey(points, triangles)
    if not (report.closed and report.manifold and report.oriented):
        problem = f"{len(muscle.triangles)} triangles cannot be decimated to {count}; the full mesh is solved"
        warnings.warn(f"PBDDeformer: muscle: {problem}", stacklevel=2)
        return None
    fixed_to = coarse_fixed_points(fine, muscle.fixed_to[np.unique(muscle.triangles)], points)
    return FixedMuscle(points, triangles, fixed_to, muscle.fibres)
