"""TautPaths: paths of a muscle, taut around the moving bones."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.errors import InputError, errors_at
from vtkmuscle.core.fixed_muscle import FixedMuscle
from vtkmuscle.core.mesh.polylines import evenly_spread
from vtkmuscle.core.paths.bows import free_shares
from vtkmuscle.core.paths.guides import ALL_PATHS, LEAST_PATHS, with_bones
from vtkmuscle.core.paths.levers import pull_of, rates_of
from vtkmuscle.core.paths.lines import bones_at_ends, lines_on_surface
from vtkmuscle.core.paths.neighbours import path_lengths
from vtkmuscle.core.paths.poses import KeptPoses
from vtkmuscle.core.paths.sheet import POINTS, MusclePaths, PathState
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data import paths as stored
from vtkmuscle.data.arrays import Polylines, add_arrays, array_of, polylines_from
from vtkmuscle.data.attachments import rings_by_bone
from vtkmuscle.data.moving_bones import MovingBones, RestBones, fixed_muscle
from vtkmuscle.data.muscle_geometry import Surface
from vtkmuscle.filters.base import Filter, InputPort, OutputPort, Parameter, ports
from vtkmuscle.filters.base.parameters import quality_of

#: Segments of a path, and solved paths, by quality. Of more than 100 fibres 100 have solved paths: what the
#: others err, and how much faster it is, is measured in docs/explanation/accuracy_and_speed.rst.
PATH_PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "preview": {"resolution": 24, "n_paths": 25},
        "balanced": {"resolution": POINTS - 1, "n_paths": 100},
        "accurate": {"resolution": 2 * (POINTS - 1), "n_paths": ALL_PATHS},
    }
)


class TautPaths(Filter):
    """Compute the taut paths of a muscle around the moving bones.

    Each path begins as a fibre, from bone to bone: the length is the musculotendon length, and the pull has
    the moment arm. A path keeps its initial offset from each bone and the distance to neighbouring paths,
    keeps its curve at rest away from bones, and passes through via rings. Otherwise a path is as short as
    possible. The paths of a muscle form a sheet with minimal energy (:mod:`vtkmuscle.core.paths.sheet`).

    Without ``rest_fibres``, lines over the surface replace fibres, along the harmonic function between points
    fixed to different bones. A muscle fixed to a single bone then has no paths.

    The solve of a pose starts from the nearest computed pose, or from rest, along the screws of the bones.
    Lengths and levers depend on the start only within the solver's tolerance; the side of a bone may depend
    on the start where both sides are possible.

    Parameters
    ----------
    rest_fibres
        Polylines at rest, origin to insertion.
    rest_muscle
        The muscle at rest, closed triangles, with the point array ``FixedTo``; a path's end moves with the
        bone of the nearest fixed point.
    rest_bones
        Bones at rest, in named blocks, in the order of ``FixedTo``.
    bones
        The same bones at the pipeline's time, each with the field array ``Transform`` (16, row major): rest
        to now. Levers need the field arrays ``Twist_COORDINATE`` of BoneMotion.
    attachments
        Via rings for the paths to pass through; other areas are ignored.
    quality
        Preset of the resolution and the number of solved paths.
    resolution
        Segments of a path. Bone distance fields use half the segment length as spacing. Around a cylinder 16
        segments have moment arms 1 % smaller than 32 and 64, which agree; time grows with the resolution.
    n_paths
        Number of solved paths; all, if there are no more fibres. Fewer carry the paths of the other fibres by
        fixed weights; the output has the paths of all fibres. Time grows faster than the number of solved
        paths.
    levers
        Compute the moment arm of each path for each coordinate.
    bows
        Compute ``Bow`` and ``BowLever_COORDINATE``, parts of the errors of means.
    checkpoint_memory
        Memory for computed poses.

    Attributes
    ----------
    output
        The paths, with the cell and field arrays of the rest fibres; the point array ``RestPosition`` (3);
        the cell arrays ``Length``, ``RestLength`` [mm], ``Ratio`` (Length / RestLength), ``Contact`` (number
        of points under pressure from bones or rings), ``Squeezed``, missing room between two bones [mm],
        ``Sag``, depth to which straight segments cut into bones [mm], about the error of the lever, and
        ``Lever_COORDINATE``, moment arm for each coordinate of the bones' twists [mm], ``Bow`` [mm] and
        ``BowLever_COORDINATE``, parts of length and lever beyond those of the straight line, for paths off
        the bones that bent them at rest (:mod:`vtkmuscle.core.paths.bows`); the field arrays
        ``Unsettled``, 1 if the sheet did not come to rest, here or at rest, ``PathSteps``, steps of Newton's
        method, and ``Passed``, share of the paths that have passed through a bone since rest. Lengths, ratios
        and levers of an unsettled sheet are NaN.

    Raises
    ------
    ValueError
        If a fibre has no length, or runs against the first, or all are off the muscle; if the muscle is not
        closed or has no ``FixedTo``, or no fixed point; if ``rest_bones`` and ``bones`` have different
        blocks; if a bone has no ``Transform``.

    References
    ----------
    Modenese, Kohout 2020, doi:10.1007/s10439-020-02490-4, for the moment arms compared with in the
    documentation.

    Limitations
    -----------
    Paths have no mass, no friction and no activation. Too few segments give wrong lengths and levers on
    strongly wrapped muscles, where ``Sag`` is large. The side of a bone depends on the start where both sides
    are possible.

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

    quality = quality_of(PATH_PRESETS)
    resolution = Parameter(int, default=POINTS - 1, minimum=4, maximum=1000)
    n_paths = Parameter(int, default=100, minimum=LEAST_PATHS, maximum=ALL_PATHS)
    levers = Parameter(bool, default=True)
    bows = Parameter(bool, default=True)
    checkpoint_memory = Parameter(float, default=64.0, minimum=0.0, units="MB")

    rest_fibres = ports.Lines(optional=True)
    rest_muscle = ports.RestSurface()
    rest_bones = ports.RestBones()
    bones = ports.MovingBones()
    attachments = InputPort(vtkMultiBlockDataSet, optional=True)
    output = OutputPort(vtkPolyData)

    times_from = "bones"

    def execute(
        self, rest_fibres: Polylines | None, rest_muscle: Surface, rest_bones: RestBones, bones: MovingBones,
        attachments: vtkMultiBlockDataSet | None,
    ) -> vtkPolyData:  # fmt: skip
        """Return the paths at the requested time."""
        rest_bones.check_same(bones)
        names = list(rest_bones.surfaces)
        rings = rings_by_bone(attachments, names, "attachments")
        fixed = fixed_muscle(rest_muscle, names, rest_fibres, rings)
        kept = self.once("paths", (fixed, rest_bones.shapes, self.resolution, self.n_paths), _paths_at_rest)
        if kept is None:
            return vtkPolyData()
        poses, end_bones, held = kept
        state = poses.at(bones.transforms, memory=self.checkpoint_memory * 1e6)
        self.report_progress(1.0)
        levers = state.levers(bones.twists) if self.levers else {}
        count, n, _ = state.paths.shape
        points, offsets = state.paths.reshape(-1, 3), n * np.arange(count + 1)
        made = Polylines(points, offsets)
        result = polylines_from(made) if rest_fibres is None else rest_fibres.moved(points, offsets)
        rest = poses.rest
        settled = state.settled and rest.settled
        measures = {stored.LENGTH: state.lengths, "Ratio": state.lengths / rest.lengths}
        measures |= {array_of(stored.LEVER, name): values for name, values in levers.items()}
        if self.bows:
            twists = np.array([bones.twists[name] for name in levers]).reshape(-1, len(bones.transforms), 6)
            measures |= _bows(state, held, levers, twists, end_bones)
        of_solved = {"Contact": state.contacts, stored.SQUEEZED: state.squeezed, stored.SAG: state.sags}
        cells = {name: state.per_fibre(values) for name, values in of_solved.items()}
        cells |= {name: values if settled else np.full(count, np.nan) for name, values in measures.items()}
        cells["RestLength"], rest_points = rest.lengths, {stored.REST_POSITION: rest.paths.reshape(-1, 3)}
        fields = {stored.UNSETTLED: int(not settled), stored.PATH_STEPS: state.steps}
        fields |= {stored.PASSED: state.passed.mean()}
        return add_arrays(result, points=rest_points, cells=cells, fields=fields)


def _bows(
    state: PathState, held: Floats, levers: Mapping[str, Floats], twists: Floats, end_bones: tuple[Ints, Ints]
) -> dict[str, Floats]:
    """Return the parts of lengths and levers that are of bows off the bones."""
    free, lines = state.per_fibre(free_shares(state, held)), state.paths[:, [0, -1]]
    pull, bows = pull_of(lines), {stored.BOW: free * (state.lengths - path_lengths(lines))}
    for (name, lever), twist in zip(levers.items(), twists, strict=True):
        straight = np.einsum("fni,fni->f", pull, with_bones(lines, *end_bones, rates_of(twist)))
        bows[array_of(stored.BOW_LEVER, name)] = free * (lever - straight)
    return bows


def _paths_at_rest(
    muscle: FixedMuscle, bones: Mapping[int, Bone], resolution: int, n_paths: int
) -> tuple[KeptPoses, Any, Any] | None:
    """Return the paths, their ends' bones, and free shares of bows; None without paths."""
    points, triangles, fixed_to, fibres, rings = muscle
    with errors_at("rest_muscle"):
        topology = muscle.topology()
        lines = fibres or lines_on_surface(points, topology, fixed_to)
    if lines is None:
        return None
    paths = evenly_spread(*lines, resolution + 1)
    with errors_at("rest_fibres"):
        muscle.check_lines(paths)
        first, last = ends = bones_at_ends(paths, points, fixed_to)
        near, far = (np.linalg.norm(paths[:, 0] - paths[0, end], axis=1) for end in (0, -1))
        back = (first == last[0]) & (last == first[0]) & (first != last) & (far < near)
        if back.any():  # paths side by side go with each other from start to end
            raise InputError("", f"fibre {back.argmax()} runs the other way than fibre 0", "turn it round")
        made = MusclePaths(paths, *ends, (points, triangles), bones, rings=rings, n_paths=n_paths)
    return KeptPoses(made), ends, free_shares(made.rest)
