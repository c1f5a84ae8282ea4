"""TautFibres: fibres as the shortest paths between their ends, round the bones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.errors import InputError, errors_at
from vtkmuscle.core.fixed_muscle import FixedMuscle
from vtkmuscle.core.paths.lines import bones_at_ends, evenly_spread
from vtkmuscle.core.paths.sheet import POINTS, MusclePaths, PathState
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import Polylines, set_cell_array, set_field_array
from vtkmuscle.data.attachments import rings_by_bone
from vtkmuscle.data.moving_bones import MovingBones, RestBones, fixed_points_of
from vtkmuscle.data.muscle_geometry import Surface
from vtkmuscle.data.paths import PATH_POINTS, path_arrays
from vtkmuscle.filters.base import HistoryFilter, InputPort, OutputPort, Parameter, ports


class _Frame(NamedTuple):
    """The paths in a pose, and the twists of the bones there."""

    state: PathState
    twists: Mapping[str, Floats]

    @property
    def nbytes(self) -> int:
        """Memory that it takes [bytes]."""
        return self.state.nbytes


class TautFibres(HistoryFilter[_Frame]):
    """Pull fibres taut round the moving bones: the paths of a muscle, without its volume.

    Each fibre is the path of its part of the muscle, from bone to bone: its length is that of the
    musculotendon unit, and its pull has the moment arm. It keeps away from each bone by what of the muscle
    lies between the two at rest, keeps its distance from the paths beside it, has the bow that it has at rest
    where no bone holds that, and passes through via rings. Otherwise it is as short as it can be. All paths
    of a muscle are one sheet, whose energy has a minimum there (:mod:`vtkmuscle.core.paths.sheet`).

    PBDDeformer carries a muscle by the same paths. Alone they cost a part of that.

    Where bones have time steps, each pose is reached from the one before, however it is asked for; a path
    that can lie on either side of a bone is where that way leads.

    Parameters
    ----------
    rest_fibres
        Polylines at rest, origin to insertion.
    rest_muscle
        The muscle at rest, closed triangles, with the point array ``FixedTo``; an end of a fibre goes with
        the bone of the fixed point nearest to it.
    bones
        Bones at the pipeline's time, each with the field array ``Transform`` (16, row major): rest to now.
        For moment arms they have ``Twist_COORDINATE`` as well, as BoneMotion gives them.
    attachments
        For the via rings among them, which paths pass through.
    resolution
        Segments of a path. Paths of 16 round a cylinder have moment arms 1 % less than those of 32 and 64,
        which agree; the time grows with it.
    checkpoint_memory
        Memory for poses kept to go back in time; the last two are kept even with 0.

    Attributes
    ----------
    output
        The paths, with the cell and field arrays of the rest fibres and the cell arrays ``Length``,
        ``RestLength`` (at rest) [mm], ``Ratio`` (of the two), ``Contact`` (points that bones or rings press
        on), ``PathLength`` (the length again, as that of the paths) and ``PathLever_COORDINATE``, the moment
        arm by each coordinate of which the bones have the twists, and the field array ``Unsettled``, 1 where
        the sheet did not come to rest.

    Raises
    ------
    ValueError
        If there are no fibres, or one has no length; if the muscle is not closed or has no ``FixedTo``, or no
        point of it is fixed; if a bone has no field array ``Transform``.

    References
    ----------
    Modenese, Kohout 2020, doi:10.1007/s10439-020-02490-4, for the moment arms that they are compared with in
    the documentation.

    Examples
    --------
    >>> from vtkmuscle.filters import BoneMotion, FixedPointDetector, TautFibres
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> from vtkmuscle.pipelines import decompose
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> attachments = phantom.attachments[name]
    >>> fixed = FixedPointDetector()(muscle, phantom.bones, attachments)
    >>> moving = BoneMotion(bones=phantom.bones, motion=phantom.motion)
    >>> fibres = decompose(muscle, attachments, n_fibres=8)
    >>> taut = TautFibres(rest_fibres=fibres, rest_muscle=fixed, bones=moving).apply()
    >>> taut.n_cells, bool((taut["Length"] > 0).all())
    (8, True)
    """

    resolution = Parameter(int, default=POINTS - 1, minimum=4, maximum=1000)
    checkpoint_memory = Parameter(float, default=64.0, minimum=0.0, units="MB")

    rest_fibres = ports.Lines()
    rest_muscle = ports.Surface()
    bones = ports.MovingBones()
    attachments = InputPort(vtkMultiBlockDataSet, optional=True)
    output = OutputPort(vtkPolyData)

    moving = ("bones",)

    def __init__(self, **settings: Any) -> None:
        self._rest_bones = RestBones(type(self).__name__)
        self._paths: MusclePaths | None = None
        self._rest: FixedMuscle | None = None
        super().__init__(**settings)

    def forget(self) -> None:
        """Drop all poses, and the paths."""
        super().forget()
        self._paths = None

    def execute(
        self,
        rest_fibres: Polylines,
        rest_muscle: Surface,
        bones: MovingBones,
        attachments: vtkMultiBlockDataSet | None,
    ) -> vtkPolyData:
        """Return the paths at the time asked for."""
        if self._is_new(rest_fibres, rest_muscle, bones.names, attachments):
            self._prepare(self.data_at("bones", bones, self.path[0]))
        paths = self._paths
        assert paths is not None

        def advance(before: _Frame | None, now: MovingBones) -> _Frame:
            state = paths.follow(paths.rest if before is None else before.state, now.transforms)
            self.report_part(1.0)
            return _Frame(state, now.twists)

        return self._result(rest_fibres, paths, self.frame((bones,), advance))

    def _is_new(
        self,
        lines: Polylines,
        muscle: Surface,
        names: list[str],
        attachments: vtkMultiBlockDataSet | None,
    ) -> bool:
        """Take what the paths are made from; return whether that is another than before."""
        fixed_to = fixed_points_of(muscle, names)
        if (fixed_to < 0).all():
            problem = "no point is fixed to a bone, so that the fibres' ends have nothing to go with"
            raise InputError(muscle.where, problem, "detect the fixed points with these bones")
        rings = rings_by_bone(attachments, names, "attachments")
        fibres = lines.points, lines.offsets
        given = FixedMuscle(muscle.points, muscle.triangles, fixed_to, fibres, rings=rings)
        if self._paths is not None and given.same_as(self._rest):
            return False
        self._rest = given
        self.forget()
        return True

    def _prepare(self, bones: MovingBones) -> None:
        """Make the paths at rest."""
        given = self._rest
        assert given is not None
        assert given.fibres is not None
        self._rest_bones.take(bones)
        fibres = evenly_spread(*given.fibres, self.resolution + 1)
        with errors_at("rest_fibres"):
            self._paths = MusclePaths(
                fibres,
                *bones_at_ends(fibres, given.points, given.fixed_to),
                given.points,
                given.triangles,
                self._rest_bones.bones,
                rings=given.rings,
            )

    def _result(self, rest_fibres: Polylines, paths: MusclePaths, frame: _Frame) -> vtkPolyData:
        state = frame.state
        count, n, _ = state.points.shape
        result = rest_fibres.moved(state.points.reshape(-1, 3), n * np.arange(count + 1))
        lengths, rest = state.lengths, paths.rest.lengths
        found = path_arrays(state.points, state.levers(frame.twists), state.squeezed)
        del found[PATH_POINTS]  # the lines themselves
        for name, values in (
            *found.items(),
            ("Length", lengths),
            ("RestLength", rest),
            ("Ratio", lengths / rest),
            ("Contact", state.contacts),
        ):
            set_cell_array(result, name, values)
        set_field_array(result, "Unsettled", int(not state.settled))
        return result
