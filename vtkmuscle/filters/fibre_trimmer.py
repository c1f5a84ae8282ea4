"""FibreTrimmer: end fibres on the attachment areas."""

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.attachments.patches import discs_over
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.trimming import EndArea, ends_as_printed, trim_fibres
from vtkmuscle.core.mesh.sampling import PatchSamples
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import Polylines, add_arrays, field_array
from vtkmuscle.data.attachments import Areas
from vtkmuscle.data.muscle_geometry import ROUGHNESS, MuscleGeometry, Surface
from vtkmuscle.filters.base import Filter, OutputPort, Parameter, ports

#: Largest part of a fibre's length that is cut off at either end: beyond, the ends would meet.
LARGEST_CUT = 0.5


class FibreTrimmer(Filter):
    """End fibres on the attachment areas, evenly spread.

    Near a wide attachment area, template fibres meet in a point or run along the area. Two planes across the
    muscle's axis, each through the landmark deepest in the muscle, cut the fibre ends off; straight segments
    lead to evenly spread ends on the areas, without crossings. The cut moves for a segment that would leave
    the muscle or turn by more than 30 degrees. If most fibres end on an area without meeting, as pennate
    fibres do, the fibres keep their ends. An area may lie within the muscle, as in bipennate muscles.

    The axis comes from the field array ``Transform`` of a fitted template, or runs between the centroids of
    the areas. Each fibre keeps its number of points, evenly spaced; points outside move to the surface.

    Parameters
    ----------
    fibres
        Polylines from the origin to the insertion.
    muscle
        The muscle's surface, triangles.
    attachments
        Areas of both roles, landmarks near the muscle.
    end_rule
        ``"kept"``: fibres keep their ends where most fibres end on the area, else each fibre ends at a share
        of the area. ``"shared"``: always at a share; isolines may end all fibres at the rim, and leave the
        muscle behind the area bare. ``"closest"``: at the point of the area closest to the fibre's ray
        (Kohout et al. 2012), without new spacing of points.

    Attributes
    ----------
    output
        The trimmed polylines, with the cell and field arrays of the input, and the field array ``EndsKept``:
        part of the fibres with unchanged ends, at the origin and at the insertion.

    Raises
    ------
    ValueError
        If a fibre has fewer than two points; if the muscle is not closed; if a role has no area, or an area
        off the muscle; if the axis is undefined because the centroids of both sides coincide.

    References
    ----------
    Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.4,
    extended in doi:10.1007/978-3-642-38241-3_3.

    Limitations
    -----------
    Segments to the areas are straight, so a fibre has a kink at the cut, of up to 60 degrees if a cut allows.
    At most half of a fibre is cut off, which may leave ends off an area along most of the muscle.

    Examples
    --------
    >>> from vtkmuscle.filters import FibreTemplateSource, FibreTrimmer, SliceMorpher, TemplateFitter
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> phantom = spindle_over_hinge()
    >>> (name, muscle), = phantom.muscles.items()
    >>> attachments = phantom.attachments[name]
    >>> fitted = TemplateFitter()(FibreTemplateSource(n_fibres=20)(), muscle, attachments)
    >>> fibres = SliceMorpher()(fitted, muscle, attachments)
    >>> trimmed = FibreTrimmer()(fibres, muscle, attachments)
    >>> trimmed.GetNumberOfCells(), trimmed.GetNumberOfPoints() == fibres.GetNumberOfPoints()
    (20, True)
    """

    end_rule = Parameter(str, default="kept", choices=("kept", "shared", "closest"))

    fibres = ports.Lines()
    muscle = ports.Surface()
    attachments = ports.Areas()
    output = OutputPort(vtkPolyData)

    def execute(self, fibres: Polylines, muscle: Surface, attachments: Areas) -> vtkPolyData:
        """Return the trimmed fibres."""
        points, offsets = fibres.points, fibres.offsets
        short = np.flatnonzero(np.diff(offsets) < 2)
        if len(short):
            problem = f"{len(short)} fibre(s) have fewer than two points, first {short[0]}"
            raise InputError("fibres", problem, "give each fibre two points or more")
        geometry = muscle.closed("and so no inside to keep fibres in")
        ends = offsets[:-1], offsets[1:] - 1
        origin = _end_area("origin", attachments, geometry, points[ends[0]])
        insertion = _end_area("insertion", attachments, geometry, points[ends[1]])
        self.report_progress(0.2)
        axis = _axis(fibres.data, origin, insertion)
        if self.end_rule == "closest":
            printed = ends_as_printed(points, offsets, axis=axis, origin=origin, insertion=insertion)
            return fibres.moved(*printed)
        limits = geometry.solids.into, ROUGHNESS * geometry.mean_edge, LARGEST_CUT
        areas, keep = (origin, insertion), self.end_rule == "kept"
        trimmed = trim_fibres(points, offsets, axis=axis, areas=areas, limits=limits, keep=keep)
        kept = (trimmed == points).all(axis=1)
        shares = np.array([kept[end].mean() for end in ends])
        return add_arrays(fibres.moved(trimmed), fields={"EndsKept": shares})


def _end_area(role: str, areas: Areas, geometry: MuscleGeometry, ends: Floats) -> EndArea:
    """Return a role's area for fibre ends (k, 3)."""
    covered = geometry.covered(areas, role)
    role_areas = [area for area in areas if area.role == role]
    rings = [part for area in role_areas for part in (area.landmarks, area.closed)]
    inner, outer = geometry.once("discs", rings, lambda: _discs_of(role_areas, geometry))
    landmarks = np.vstack([area.landmarks for area in role_areas])
    # The area may be hollow, or the landmarks inexact: the template's fibre ends decide.
    if inner is not None and (inner.distances(ends) <= ROUGHNESS * geometry.mean_edge).mean() > 0.5:
        return EndArea(landmarks, inner)
    return EndArea(landmarks, covered, outer)


def _discs_of(areas: Areas, geometry: MuscleGeometry) -> tuple[PatchSamples | None, PatchSamples | None]:
    """Return the discs deep in a muscle, and those on its surface.

    None for none. A disc is deep where half of it is deeper than a mean edge. Discs over rings around hollow
    or bulging areas do not belong to the surface.
    """
    inner, flat = [], []
    for ring in (area.landmarks for area in areas if area.closed):
        points, triangles = discs_over([ring])
        away = geometry.solids.distances(points[triangles].mean(axis=1))
        if np.abs(away).max() <= ROUGHNESS * geometry.mean_edge:
            flat.append(ring)
        elif np.median(away) < -geometry.mean_edge:
            inner.append(ring)
    return _samples(*discs_over(inner)), _samples(*discs_over(flat))


def _samples(points: Floats, triangles: Ints) -> PatchSamples | None:
    return PatchSamples(points, triangles, np.arange(len(points))) if len(triangles) else None


def _axis(fibres: vtkPolyData | None, origin: EndArea, insertion: EndArea) -> Floats:
    """Return the unit vector from the origin to the insertion."""
    transform = field_array(fibres, "Transform")
    if transform is not None and transform.size == 16:
        # The template's cube has its origin area at z = 0 and its insertion area at z = 1.
        axis = np.array(transform, dtype=np.float64).reshape(4, 4)[:3, 2]
    else:
        axis = insertion.landmarks.mean(axis=0) - origin.landmarks.mean(axis=0)
    length = float(np.linalg.norm(axis))
    if not np.isfinite(length) or length == 0.0:
        why = "the areas' centroids coincide, or the fibres' field array 'Transform' is singular"
        problem = f"the axis from the origin to the insertion has no direction: {why}"
        raise InputError("", problem, "check the attachment areas")
    return axis / length
