"""FibreSource: fill a muscle with fibres."""

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres import between_areas
from vtkmuscle.data.arrays import Polylines, add_arrays, polylines_from
from vtkmuscle.data.attachments import ROLES, Aponeurosis, Areas, aponeuroses_of, areas_of_role
from vtkmuscle.data.muscle_geometry import ROUGHNESS, Surface, aponeurosis_surfaces, joined_surface
from vtkmuscle.filters.base import Filter, InputPort, OutputPort, Parameter, ports
from vtkmuscle.filters.fibre_smoother import FibreSmoother
from vtkmuscle.filters.fibre_template_source import FibreTemplateSource
from vtkmuscle.filters.fibre_trimmer import FibreTrimmer
from vtkmuscle.filters.slice_morpher import SliceMorpher
from vtkmuscle.filters.template_fitter import TemplateFitter

#: Least filled part of a muscle's sections across straight fibres. Blocks between plates, bipennate, pennate
#: and parallel, have 0.74, 0.9 and 1, a measured gastrocnemius 2.4, spindles 0.06 to 0.2, a fan 0.54.
LEAST_FILLED = 0.6
#: Largest part of straight fibres outside of the muscle. Of muscles that straight fibres fill, phantoms of
#: parallel fibres have 0, 15 real ones 0.17 to 1.
MOST_LEAVING = 0.1


class FibreSource(Filter):
    """Fill a muscle with fibres.

    Straight fibres connect the two areas: positions for equal shares of each area are matched by the least
    sum of squared distances (optimal transport), so that fibres do not cross. A line outside of the muscle is
    bent inwards. Between aponeuroses fibres keep their cross-section: a part of the larger aponeurosis stays
    empty. Fibres through sections start from the parallel template and run through TemplateFitter,
    SliceMorpher (isolines, or planes for overlapping areas), FibreTrimmer and FibreSmoother, to fill muscles
    thicker than the attachment areas.

    ``course="auto"`` takes straight fibres between aponeuroses, and for muscles of which straight fibres fill
    more than 60 % of the sections across the fibres, with at most a tenth of the fibres outside; otherwise,
    and with superficial fibres, sections. The choice is in ``Course``.

    Parameters
    ----------
    muscle
        The muscle's surface: triangles, closed.
    attachments
        Areas of both roles; not needed between aponeuroses.
    superficial
        Fibres seen on the surface, for sections.
    aponeuroses
        End surfaces of fibres, in place of the attachment areas: a block for each ring on the muscle's
        surface or surface within the muscle, with the field array ``Side`` (``proximal`` or ``distal``).
    n_fibres
        Number of fibres.
    resolution
        Segments of each fibre, one less than points.
    course
        Course of fibres: straight from area to area, through sections, or the better of the two.

    Attributes
    ----------
    output
        Polylines from origin to insertion, with the point array ``t`` (0 to 1), the cell array ``FibreId``,
        the field array ``Course`` (``straight`` or ``sections``), and the muscle's field arrays. If straight
        fibres were tried, also ``FilledShare`` (filled part of the sections) and ``LeavingShare`` (part of
        the fibres outside). Straight fibres have the cell array ``Bent`` (0 or 1); fibres through sections
        the arrays of the filters above.

    Raises
    ------
    ValueError
        If the muscle is not closed; if there are neither aponeuroses nor attachments of both roles; if the
        two areas share more than half of the points of the larger one; if an aponeurosis is far from the
        muscle, covers the muscle, or overlaps the other, or the two are exchanged; if ``course="sections"``
        is combined with aponeuroses.

    References
    ----------
    Villani 2009, *Optimal Transport*, doi:10.1007/978-3-540-71050-9.

    Limitations
    -----------
    Fibres are a geometric model: they agree with measured fascicles only as far as areas and aponeuroses do.
    Muscles with several bellies on one tendon need a surface per belly. Straight fibres do not curve around
    neighbouring structures.

    Examples
    --------
    >>> from vtkmuscle.filters import FibreSource
    >>> from vtkmuscle.phantoms import pennate_block
    >>> phantom = pennate_block()
    >>> (name, muscle), = phantom.muscles.items()
    >>> fibres = FibreSource(n_fibres=20)(muscle, phantom.attachments[name])
    >>> fibres.GetNumberOfCells(), fibres.GetNumberOfPoints()
    (20, 320)
    """

    n_fibres = Parameter(int, default=100, minimum=1, maximum=100_000)
    resolution = Parameter(int, default=15, minimum=1, maximum=10_000)
    course = Parameter(str, default="auto", choices=("auto", "straight", "sections"))

    muscle = ports.Surface()
    attachments = ports.Areas(optional=True)
    superficial = InputPort(vtkPolyData, optional=True)
    aponeuroses = InputPort(vtkMultiBlockDataSet, aponeuroses_of, optional=True)
    output = OutputPort(vtkPolyData)

    def execute(
        self, muscle: Surface, attachments: Areas | None, superficial: vtkPolyData | None,
        aponeuroses: list[Aponeurosis] | None,
    ) -> vtkPolyData:  # fmt: skip
        """Return the fibres."""
        if self.course == "sections" and aponeuroses is not None:
            problem = "course='sections' leads fibres between attachment areas, but aponeuroses are connected"
            raise InputError("", problem, "use course='auto' or 'straight', or leave the aponeuroses out")
        if attachments is None and aponeuroses is None:
            raise InputError("", "no attachments are connected", "connect attachments or aponeuroses")
        areas = attachments or []
        ends = [set(muscle.geometry.attached(areas, role)) for role in ROLES if aponeuroses is None]
        if ends and 2 * len(ends[0] & ends[1]) > max(map(len, ends)):
            raise InputError("attachments", "origin and insertion share most points", "correct the landmarks")
        if aponeuroses is None and (self.course == "sections" or superficial is not None):
            return _passed_on(self._by_sections(muscle, areas, superficial), muscle)
        geometry = muscle.closed("and so no inside to keep fibres in")
        if aponeuroses is not None:
            origin, insertion = aponeurosis_surfaces(aponeuroses, geometry, "aponeuroses", areas)
        else:
            sides = ((areas_of_role(areas, role), geometry, f"attachments: {role} area") for role in ROLES)
            origin, insertion = (joined_surface(*side) for side in sides)
        self.report_progress(0.2)
        fibres = between_areas.straight_fibres(origin, insertion, self.n_fibres, self.resolution)
        surface = geometry.points, geometry.triangles
        filled = between_areas.filled_share(fibres, origin, insertion, *surface)
        self.report_progress(0.6)
        outside = between_areas.departures(fibres, geometry.solids.into)
        leaving = float((outside > ROUGHNESS * geometry.mean_edge).mean())
        suits = filled > LEAST_FILLED and leaving <= MOST_LEAVING
        if suits or self.course == "straight" or aponeuroses is not None:
            bent = outside > 0.0
            fibres[bent] = between_areas.bend_inside(fibres[bent], geometry.solids.into)
            lines = Polylines(fibres.reshape(-1, 3), np.arange(len(fibres) + 1) * fibres.shape[1])
            result = add_arrays(
                polylines_from(lines),
                points={"t": np.tile(np.linspace(0.0, 1.0, fibres.shape[1]), len(fibres))},
                cells={"FibreId": np.arange(len(fibres)), "Bent": bent.astype(np.int64)},
                fields={"Course": "straight"},
            )
        else:
            result = self._by_sections(muscle, areas, superficial)
        add_arrays(result, fields={"FilledShare": filled, "LeavingShare": leaving})
        return _passed_on(result, muscle)

    def _by_sections(self, muscle: Surface, areas: Areas, superficial: vtkPolyData | None) -> vtkPolyData:
        """Return the parallel template mapped through the muscle's sections."""
        template = FibreTemplateSource(n_fibres=self.n_fibres, resolution=self.resolution)()
        fitted = TemplateFitter()(template, muscle.data, areas, superficial)
        origin, insertion = (muscle.geometry.attached(areas, role) for role in ROLES)
        # Isolines run between areas that are apart.
        method = "plane" if len(np.intersect1d(origin, insertion)) else "harmonic"
        morphed = SliceMorpher(method=method)(fitted, muscle.data, areas, superficial)
        trimmed = FibreTrimmer(end_rule="shared")(morphed, muscle.data, areas)
        result: vtkPolyData = FibreSmoother()(trimmed, muscle.data, areas)
        return add_arrays(result, fields={"Course": "sections"})


def _passed_on(fibres: vtkPolyData, muscle: Surface) -> vtkPolyData:
    """Add missing field arrays of the muscle to its fibres."""
    target, source = fibres.GetFieldData(), muscle.data.GetFieldData()
    for number in range(source.GetNumberOfArrays()):
        if not target.HasArray(source.GetArrayName(number)):
            target.AddArray(source.GetAbstractArray(number))
    return fibres
