"""LinearBlendFibres: move fibres with two bones, without a muscle."""

from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.blending import blend_fibres
from vtkmuscle.data.arrays import Polylines, add_arrays
from vtkmuscle.data.moving_bones import MovingBones
from vtkmuscle.filters.base import Filter, OutputPort, Parameter, ports


class LinearBlendFibres(Filter):
    """Move fibres by blending the motions of two bones.

    A point moves to v' = w T_origin v + (1 - w) T_insertion v, with w = a t^2 - (a + 1) t + 1 and t from 0 at
    the fibre's origin to 1 at the insertion; ``a`` bends the course a little towards one bone. The paper has
    a = -0.042 for psoas and gluteus maximus, -0.024 for the iliacus and 0 for the gluteus medius, by trial.

    Parameters
    ----------
    rest_fibres
        Polylines at rest, origin to insertion.
    bones
        Named blocks with the field array ``Transform`` (16), rest to now.
    a
        Curvature of the weights over the fibre.
    origin
        Bone of the fibres' first points; None: the first block.
    insertion
        Bone of the fibres' last points; None: the last block.

    Attributes
    ----------
    output
        The moved polylines, with the arrays of the rest fibres, the cell array ``RestLength`` (n_fibres,)
        [mm], and the field array ``BlendA``.

    Raises
    ------
    ValueError
        If a bone named by ``origin`` or ``insertion`` is missing.

    References
    ----------
    Modenese, Kohout 2020, *Automated generation of three-dimensional complex muscle geometries for use in
    personalised musculoskeletal models*, doi:10.1007/s10439-020-02490-4.

    Limitations
    -----------
    Fibres pass through bones, and volume is not kept. With a = -1 fibres follow the origin's bone for most of
    their length and take up all motion close to the insertion, so their lengths mean little.

    Examples
    --------
    >>> from vtkmuscle.filters import BoneMotion, LinearBlendFibres
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> from vtkmuscle.pipelines import decompose
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> rest = decompose(muscle, phantom.attachments[name], n_fibres=8)
    >>> bones = BoneMotion(bones=phantom.bones, motion=phantom.motion)
    >>> blend = LinearBlendFibres(rest_fibres=rest, bones=bones, origin="proximal", insertion="distal")
    >>> blend.output.GetNumberOfCells()
    8
    """

    a = Parameter(float, default=0.0, minimum=-1.0, maximum=1.0)
    origin: Parameter[str | None] = Parameter(str, default=None)
    insertion: Parameter[str | None] = Parameter(str, default=None)

    rest_fibres = ports.Lines()
    bones = ports.MovingBones()
    output = OutputPort(vtkPolyData)

    times_from = "bones"

    def execute(self, rest_fibres: Polylines, bones: MovingBones) -> vtkPolyData:
        """Return the fibres now."""
        points, offsets = rest_fibres.points, rest_fibres.offsets
        ends = ("origin", self.origin, 0), ("insertion", self.insertion, -1)
        first, last = (bones.transforms[self._index(list(bones.surfaces), *end)] for end in ends)
        result = rest_fibres.moved(blend_fibres(points, offsets, first, last, self.a))
        return add_arrays(result, cells={"RestLength": rest_fibres.lengths}, fields={"BlendA": self.a})

    @staticmethod
    def _index(names: list[str], role: str, name: str | None, default: int) -> int:
        if name is None:
            return default
        if name not in names:
            raise InputError("", f"{role} is {name!r}, but the bones are {', '.join(map(repr, names))}")
        return names.index(name)
