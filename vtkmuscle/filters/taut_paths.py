"""TautPaths: the paths of a muscle, pulled taut round the moving bones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.errors import InputError, errors_at
from vtkmuscle.core.fixed_muscle import FixedMuscle
from vtkmuscle.core.mesh.surface import mesh_topology
from vtkmuscle.core.paths.lines import bones_at_ends, evenly_spread, lines_on_surface
from vtkmuscle.core.paths.poses import KeptPoses
from vtkmuscle.core.paths.sheet import POINTS, MusclePaths, PathState
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import (
    Polylines,
    add_arrays,
    array_of,
    polylines_from,
    vtk_array,
)
from vtkmuscle.data.attachments import rings_by_bone
from vtkmuscle.data.moving_bones import MovingBones, RestBones, check_same_bones, fixed_points_of
from vtkmuscle.data.muscle_geometry import Surface
from vtkmuscle.data.paths import LEVER, REST_POSITION, SQUEEZED
from vtkmuscle.filters.base import Filter, InputPort, OutputPort, Parameter, ports

#: Segments of a path by quality.
RESOLUTIONS = {"preview": 24, "balanced": POINTS - 1, "accurate": 2 * (POINTS - 1)}


class TautPaths(Filter):
    """Pull the paths of a muscle taut round the moving bones.

    Each path begins as a fibre, from bone to bone: its length is that of the musculotendon unit, and its pull
    has the moment arm. A path keeps its initial offset from each bone and its distance from neighbouring
    paths, has the bow of the rest pose where no bone holds it, and passes through via rings. Otherwise it is
    as short as possible. All paths of a muscle are one sheet, whose energy has a minimum there
    (:mod:`vtkmuscle.core.paths.sheet`).

    Without ``rest_fibres``, lines over the surface stand in for fibres, along the harmonic function between
    the points fixed to different bones. A muscle that is fixed to one bone then has no paths.

    A pose is reached from the nearest pose computed before, or from rest, along the screws of the bones.
    Lengths and levers do not depend on the start, but within the solver's tolerance; the side of a bone on
    which a path lies does, where both sides are possible.

    Parameters
    ----------
    rest_fibres
        Polylines at rest, origin to insertion.
    rest_muscle
        The muscle at rest, closed triangles, with the point array ``FixedTo``; an end of a path goes with
        the bone of the fixed point nearest to it.
    rest_bones
        Bones at rest, in named blocks; ``FixedTo`` counts them.
    bones
        The same bones at the pipeline's time, each with the field array ``Transform`` (16, row major): rest
        to now. For levers the bones also have ``Twist_COORDINATE``, as BoneMotion gives them.
    attachments
        For the via rings among them, which paths pass through.
    quality
        Preset of the resolution.
    resolution
        Segments of a path. Bone distance fields use half that spacing. Round a cylinder 16 segments have
        moment arms 1 % less than 32 and 64, which agree; the time grows with the resolution.
    levers
        Compute the moment arm of each path by each coordinate.
    checkpoint_memory
        Memory for poses to start from.

    Attributes
    ----------
    output
        The paths, with the cell and field arrays of the rest fibres; the point array ``RestPosition`` (3);
        the cell arrays ``Length``, ``RestLength`` [mm], ``Ratio`` (of the two), ``Contact`` (number of points
        that bones or rings press on), ``Squeezed``, the room that a path lacks between two bones [mm], and
        ``Lever_COORDINATE``, its moment arm by each coordinate of which the bones have twists [mm]; the field
        array ``Unsettled``, 1 where the sheet did not come to rest.

    Raises
    ------
    ValueError
        If a fibre has no length; if the muscle is not closed or has no ``FixedTo``, or no point of it is
        fixed; if ``rest_bones`` and ``bones`` have different blocks; if a bone has no ``Transform``.

    References
    ----------
    Modenese, Kohout 2020, doi:10.1007/s10439-020-02490-4, for the moment arms compared with in the
    documentation.

    Limitations
    -----------
    Paths have no mass, no friction and no activation. Fewer than 20 segments give wrong lengths and
    levers on strongly wrapped muscles. Where a path can lie on either side of a bone, the side depends on the
    start.

    Examples
    --------
    >>> from vtkmuscle.filters import BoneMotion, FixedPointDetector, TautPaths
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> from vtkmuscle.pipelines import decompose
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> attachments = phantom.attachments[name]
    >>> fixed = FixedPointDetector()(muscle, phantom.bones, attachments)
    >>> bones = {"rest_bones": phantom.bones, "bones": BoneMotion(bones=phantom.bones, motion=phantom.motion)}
    >>> fibres = decompose(muscle, attachments, n_fibres=8)
    >>> paths = TautPaths(rest_fibres=fibres, rest_muscle=fixed, **bones).apply()
    >>> paths.n_cells, bool((paths["Length"] > 0).all())
    (8, True)
    """

    quality: Parameter[str | None] = Parameter(
        str,
        default=None,
        choices=tuple(RESOLUTIONS),
        sets={name: {"resolution": segments} for name, segments in RESOLUTIONS.items()},
    )
    resolution = Parameter(int, default=POINTS - 1, minimum=4, maximum=1000)
    levers = Parameter(bool, default=True)
    checkpoint_memory = Parameter(float, default=64.0, minimum=0.0, units="MB")

    rest_fibres = ports.Lines(optional=True)
    rest_muscle = ports.Surface()
    rest_bones = ports.RestBones()
    bones = ports.MovingBones()
    attachments = InputPort(vtkMultiBlockDataSet, optional=True)
    output = OutputPort(vtkPolyData)

    times_from = "bones"

    def __init__(self, **settings: Any) -> None:
        self._shapes = RestBones()
        self._rest: tuple[FixedMuscle, dict[int, Bone], int] | None = None
        self._poses: KeptPoses | None = None
        #: Points and lengths at rest, as arrays that all outputs share.
        self._rest_arrays: dict[str, Any] = {}
        super().__init__(**settings)

    def execute(
        self,
        rest_fibres: Polylines | None,
        rest_muscle: Surface,
        rest_bones: Mapping[str, vtkPolyData],
        bones: MovingBones,
        attachments: vtkMultiBlockDataSet | None,
    ) -> vtkPolyData:
        """Return the paths at the time asked for."""
        check_same_bones(rest_bones, bones, "rest_bones")
        self._prepare(rest_fibres, rest_muscle, rest_bones, attachments)
        if self._poses is None:
            return vtkPolyData()
        state = self._poses.at(bones.transforms, memory=self.checkpoint_memory * 1e6)
        self.report_progress(1.0)
        levers = self._poses.levers(bones.transforms, bones.twists) if self.levers else {}
        return self._result(rest_fibres, state, levers)

    def _prepare(
        self,
        lines: Polylines | None,
        muscle: Surface,
        bones: Mapping[str, vtkPolyData],
        attachments: vtkMultiBlockDataSet | None,
    ) -> None:
        """Make the paths at rest, where the inputs or the resolution are new."""
        shapes = self._shapes.shapes(bones, "rest_bones")
        fixed_to = fixed_points_of(muscle, list(bones))
        if (fixed_to < 0).all():
            problem = "no point is fixed to a bone, and the ends of paths have no bone to go with"
            raise InputError(muscle.where, problem, "detect the fixed points with these bones")
        rings = rings_by_bone(attachments, list(bones), "attachments")
        fibres = None if lines is None else (lines.points, lines.offsets)
        given = FixedMuscle(muscle.points, muscle.triangles, fixed_to, fibres, rings=rings)
        if self._rest is not None:
            before, shapes_before, resolution = self._rest
            if resolution == self.resolution and shapes_before is shapes and given.same_as(before):
                return
        self._rest, self._poses = None, None
        if fibres is None:
            topology = mesh_topology(len(given.points), given.triangles)
            fibres = lines_on_surface(given.points, topology, fixed_to)
        if fibres is not None:
            paths = evenly_spread(*fibres, self.resolution + 1)
            with errors_at("rest_fibres"):
                made = MusclePaths(
                    paths,
                    *bones_at_ends(paths, given.points, fixed_to),
                    given.points,
                    given.triangles,
                    shapes,
                    rings=rings,
                )
            self._poses = KeptPoses(made)
            self._rest_arrays = {
                REST_POSITION: vtk_array(made.rest.points.reshape(-1, 3), REST_POSITION),
                "RestLength": vtk_array(made.rest.lengths, "RestLength"),
            }
        self._rest = given, shapes, self.resolution

    def _result(
        self, rest_fibres: Polylines | None, state: PathState, levers: Mapping[str, Floats]
    ) -> vtkPolyData:
        count, n, _ = state.points.shape
        points, offsets = state.points.reshape(-1, 3), n * np.arange(count + 1)
        if rest_fibres is None:
            result = polylines_from(Polylines(points, offsets))
        else:
            result = rest_fibres.moved(points, offsets)
        result.GetPointData().AddArray(self._rest_arrays[REST_POSITION])
        result.GetCellData().AddArray(self._rest_arrays["RestLength"])
        assert self._poses is not None
        lengths = state.lengths
        cells = {
            "Length": lengths,
            "Ratio": lengths / self._poses.rest.lengths,
            "Contact": state.contacts,
            SQUEEZED: state.squeezed,
        }
        cells |= {array_of(LEVER, name): values for name, values in levers.items()}
        return add_arrays(result, cells=cells, fields={"Unsettled": int(not state.settled)})
