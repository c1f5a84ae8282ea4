"""PathDeformer: deform a muscle by its taut paths."""

from typing import Any

from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkDemandDrivenPipeline, vtkExecutive

from vtkmuscle.core.errors import InputError, errors_at
from vtkmuscle.core.fibres.embedding import EmbeddedPoints
from vtkmuscle.core.skinning.carried_muscle import CarriedMuscle, CarriedPose
from vtkmuscle.data.arrays import Polylines, add_arrays, state_of
from vtkmuscle.data.moving_bones import MovingBones, RestBones, fixed_muscle
from vtkmuscle.data.muscle_geometry import Neighbours, Surface
from vtkmuscle.data.paths import PathLines
from vtkmuscle.data.pipeline_times import state_of_inputs
from vtkmuscle.filters.base import Filter, InputPort, OutputPort, Parameter, ports
from vtkmuscle.filters.base.parameters import quality_of
from vtkmuscle.filters.deformer import deformed_muscle

#: Rounds of settling by quality: time grows with the rounds.
ROUNDS = {"preview": 2, "balanced": 5, "accurate": 20}
#: Tolerance for merging the weights of fibre points during settling. Settling moves the surface by one or two
#: millimetres; merged weights have an error of a hundredth of the move.
WEIGHT_TOLERANCE = 0.3


class PathDeformer(Filter):
    """Deform a muscle by skinning to its taut paths.

    Points with a ``FixedTo`` follow their bone. The paths move the other points by skinning. Then the muscle
    *settles*: the volume is restored, points leave the bones, and the correction is diffused over the surface
    in several rounds, so that the surface stays smooth. A frame depends on its pose alone.

    Without ``paths``, or with no paths in the data (a muscle fixed to a single bone), bone motions blended by
    harmonic weights move the muscle.

    Muscles connected as ``neighbours`` do not move; this muscle stays outside of them, up to the depth at
    rest: ``neighbours={"psoas": psoas, "iliacus": iliacus}``, with their deformers.

    The second output, ``GetOutputPort(1)``, is the fibres of the paths, moved by the same skinning, and
    computed on request.

    Parameters
    ----------
    muscle
        Closed triangles in the rest pose, with the point array ``FixedTo``: -1 for a free point, else the
        index of a bone's block.
    paths
        The paths in the pose, with the point array ``RestPosition``, from TautPaths.
    rest_bones
        Bones at rest, in named blocks, as obstacles.
    bones
        The same bones at the pipeline's time, each with the field array ``Transform`` (16, row major): rest
        to now.
    neighbours
        Other muscles at the pipeline's time, as obstacles: outputs of a deformer, with the point array
        ``Displacement``.
    fibres
        The fibres at rest from which the paths were made; for the second output.
    quality
        Preset of the iterations.
    iterations
        Rounds of settling.
    bone_clearance
        Least distance between points and bones; points closer at rest may come as close.
    measure_shape
        Report changes of the muscle's shape.
    measure_penetration
        Measure the depth of points in the bones, against the triangles.

    Attributes
    ----------
    output
        The muscle at the requested time, with the arrays of the input; the point array ``Displacement`` (3)
        from rest [mm]. With ``measure_shape`` the field arrays ``VolumeRatio`` (V / V0), ``EdgeStretchP95``
        and ``EdgeStretchMax`` (l / l0), ``DihedralErrorP95`` [degrees], ``DegenerateEdges`` (whose
        angle was lost as a triangle collapsed) and ``CollidingPoints``. With ``measure_penetration``
        ``PenetrationMax`` and ``PenetrationP95`` [mm], how deep the free points are in the closed bones, and
        ``PenetratingPoints``.
    carried_fibres
        The fibres in the deformed muscle, with the arrays of ``fibres``, the cell array ``RestLength`` [mm]
        and the field array ``PointsOutside``, the number of points outside of the muscle at rest. Empty
        without ``fibres``.

    Raises
    ------
    ValueError
        If the surface is open, has faces other than triangles or encloses no volume; if ``FixedTo`` is
        missing or names a block that does not exist; if no point is fixed; if no path passes through the
        muscle at rest; if ``rest_bones`` and ``bones`` have different blocks; if a bone has no ``Transform``;
        if the second output is requested and the numbers of paths and fibres differ.

    References
    ----------
    Botsch, Sorkine 2008, *On linear variational surface deformation methods*, doi:10.1109/TVCG.2007.1054;
    Müller, Heidelberger, Teschner, Gross 2005, *Meshless deformations based on shape matching*,
    doi:10.1145/1073204.1073216.

    Limitations
    -----------
    There is no tissue law: volume is kept exactly, and the shape is the smoothest under skinning and contact.
    Fold-free surfaces are not guaranteed. Neighbouring muscles do not move.

    Examples
    --------
    >>> from vtkmuscle.filters import BoneMotion, FixedPointDetector, PathDeformer, TautPaths
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> fixed = FixedPointDetector()(muscle, phantom.bones, phantom.attachments[name])
    >>> bones = {"rest_bones": phantom.bones, "bones": BoneMotion(bones=phantom.bones, motion=phantom.motion)}
    >>> paths = TautPaths(rest_muscle=fixed, **bones)
    >>> deformer = PathDeformer(muscle=fixed, paths=paths, **bones, measure_shape=True)
    >>> bool(abs(deformer.apply(time=10.0).field_data["VolumeRatio"][0] - 1.0) < 1e-9)
    True
    """

    quality = quality_of({name: {"iterations": rounds} for name, rounds in ROUNDS.items()})
    iterations = Parameter(int, default=ROUNDS["balanced"], minimum=1, maximum=10_000)
    bone_clearance = Parameter(float, default=0.0, minimum=0.0, units="mm")
    measure_shape = Parameter(bool, default=False)
    measure_penetration = Parameter(bool, default=False)

    muscle = ports.RestSurface()
    paths = ports.Paths(optional=True)
    rest_bones = ports.RestBones()
    bones = ports.MovingBones()
    neighbours = InputPort(vtkMultiBlockDataSet, optional=True)
    fibres = ports.Lines(optional=True)
    output = OutputPort(vtkPolyData)
    carried_fibres = OutputPort(vtkPolyData)

    times_from = "bones"

    _fibres_asked = False

    def RequestDataNotGenerated(self, request: Any, inInfo: Any, outInfo: Any) -> int:
        """Omit the fibres from requests for the muscle alone."""
        self._fibres_asked = vtkExecutive.FROM_OUTPUT_PORT().Get(request) == 1
        if not self._fibres_asked:
            vtkDemandDrivenPipeline.DATA_NOT_GENERATED().Set(outInfo.GetInformationObject(1), 1)
        return 1

    def execute(
        self, muscle: Surface, paths: PathLines | None, rest_bones: RestBones, bones: MovingBones,
        neighbours: vtkMultiBlockDataSet | None, fibres: Polylines | None,
    ) -> tuple[vtkPolyData, vtkPolyData | None]:  # fmt: skip
        """Return the muscle and, on request, the fibres at the requested time."""
        rest_bones.check_same(bones)
        fixed = fixed_muscle(muscle, list(rest_bones.surfaces), fibres)
        rest, now = (None, None) if paths is None else (paths.rest, paths.points)
        made_from = fixed, rest, rest_bones.shapes, self.bone_clearance
        with errors_at("muscle"):
            carried = self.once("carried", made_from, CarriedMuscle)
        upstream = state_of_inputs(self, [] if neighbours is None else [self._number_of("neighbours")])
        near_now = self.once("neighbours", (fixed.points, upstream), lambda rest, _: Neighbours(rest))

        def posed(*_: Any) -> CarriedPose:
            near, report = near_now.at(neighbours), self.report_progress
            return carried.pose(now, bones.transforms, rounds=self.iterations, near=near, progress=report)

        def surface(pose: CarriedPose, measures: tuple[bool, bool]) -> vtkPolyData:
            moved = ((bone, bones.transforms[number]) for number, bone in rest_bones.shapes.items())
            return deformed_muscle(muscle.data, fixed, pose, carried.shape, moved, measures)

        # VTK asks for each output by itself.
        data = muscle.data, None if paths is None else paths.data, neighbours
        states = tuple(None if each is None else state_of(each) for each in data)
        pose = self.once("pose", (carried, self.iterations, bones.transforms, states), posed)
        self.report_progress(1.0)
        result = self.once("surface", (pose, (self.measure_shape, self.measure_penetration)), surface)
        if not self._fibres_asked or fibres is None:
            return result, vtkPolyData() if self._fibres_asked else None
        if paths is None or len(fibres) != len(paths.rest):
            count = "no" if paths is None else str(len(paths.rest))
            problem = f"there are {len(fibres)} for {count} paths"
            raise InputError("fibres", problem, "connect the rest_fibres of TautPaths")
        # Skinned, then displaced with the surface.
        inputs = fibres.points, muscle.points, muscle.triangles, WEIGHT_TOLERANCE
        embedded = self.once("embedded", inputs, EmbeddedPoints)
        moved = carried.fibre_points(pose)
        moved += embedded.moved(pose.surface - pose.carried, self.report_progress)
        embedded.keep_within(moved, pose.surface)
        cells = {"RestLength": fibres.lengths}
        fields = {"PointsOutside": embedded.n_outside}
        return result, add_arrays(fibres.moved(moved), cells=cells, fields=fields)
