"""FibreSource: fill a muscle with fibres, by the way that suits it."""

from __future__ import annotations

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.between_areas import EndSurface, bend_inside, filled_share, straight_fibres
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.types import Bools, Floats
from vtkmuscle.data.arrays import Polylines, add_arrays, polylines_from
from vtkmuscle.data.attachments import ROLES, Aponeurosis, AttachmentArea, aponeuroses_of
from vtkmuscle.data.end_surfaces import aponeurosis_surfaces, attached_surface
from vtkmuscle.data.muscle_geometry import MuscleGeometry, Surface
from vtkmuscle.filters.base import Filter, InputPort, OutputPort, Parameter, ports
from vtkmuscle.filters.fibre_smoother import FibreSmoother
from vtkmuscle.filters.fibre_template_source import FibreTemplateSource
from vtkmuscle.filters.fibre_trimmer import FibreTrimmer
from vtkmuscle.filters.slice_morpher import SliceMorpher
from vtkmuscle.filters.template_fitter import TemplateFitter

#: Straight fibres suit a muscle of which they fill more than this part. A block between plates is 1, a
#: measured gastrocnemius between its aponeuroses 0.69; spindles that are attached by their ends, 0.04 to 0.5.
LEAST_FILLED = 0.6
#: ... and from which no more than this part of them departs, by more than this part of its mean edge.
MOST_LEAVING, LEAVING = 0.1, 0.25


class FibreSource(Filter):
    """Fill a muscle with fibres.

    Straight fibres go from one area to the other. Positions that stand for equal shares of either area are
    matched by the least sum of squared distances (optimal transport), so that fibres do not cross and
    neighbours end beside each other. Where a straight line would leave the muscle it is bent inside. Between
    aponeuroses fibres keep their cross-section on their way: a part of the larger one stays bare.

    By sections fibres go through the muscle from section to section: the parallel template through
    TemplateFitter, SliceMorpher, FibreTrimmer and FibreSmoother. Sections are isolines, which follow a muscle
    however it is bent and end at its areas, or planes where the areas overlap. Such fibres fill muscles that
    are thicker than their attachment areas.

    ``course="auto"`` takes straight fibres between aponeuroses, and where they fill more than 60 % of the
    muscle's volume (their cross-section at the areas times their length) and at most a tenth of them leaves
    it. Otherwise, and where superficial fibres are connected, it takes sections. The choice is in ``Course``.

    Parameters
    ----------
    muscle
        The muscle's surface: triangles, closed.
    attachments
        Areas of both roles; not needed between aponeuroses.
    superficial
        Fibres that were seen on the surface, for sections.
    aponeuroses
        The surfaces that fibres end on, in place of the attachment areas: a block for each ring on the
        muscle's surface or surface within it, with the field array ``Side`` (``proximal`` or ``distal``).
    n_fibres
        Number of fibres.
    resolution
        Segments of each fibre, one less than points.
    course
        How fibres run: straight from area to area, through sections, or whichever suits the muscle.

    Attributes
    ----------
    output
        Polylines from origin to insertion, with the point array ``t`` (0 to 1), the cell array ``FibreId``,
        and the field arrays ``Course`` (``straight`` or ``sections``), and, where straight fibres were tried,
        ``FilledShare`` (part of the muscle that they fill) and ``LeavingShare`` (part of them that leaves
        it); and the muscle's field arrays. Straight ones have the cell array ``Bent`` (0 or 1); those by
        sections the arrays of the filters above.

    Raises
    ------
    ValueError
        If the muscle is not closed; if there are neither aponeuroses nor attachments of both roles; if an
        aponeurosis is far from the muscle, covers it, or overlaps the other, or the two are exchanged; if
        ``course="sections"`` is asked for between aponeuroses.

    References
    ----------
    Villani 2009, *Optimal Transport*, doi:10.1007/978-3-540-71050-9.

    Examples
    --------
    >>> from vtkmuscle.filters import FibreSource
    >>> from vtkmuscle.phantoms import pennate_block
    >>> phantom = pennate_block()
    >>> (name, muscle), = phantom.muscles.items()
    >>> fibres = FibreSource(n_fibres=20, course="straight")(muscle, phantom.attachments[name])
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
        self,
        muscle: Surface,
        attachments: list[AttachmentArea] | None,
        superficial: vtkPolyData | None,
        aponeuroses: list[Aponeurosis] | None,
    ) -> vtkPolyData:
        """Return the fibres."""
        if self.course == "sections" and aponeuroses is not None:
            raise InputError(
                "",
                "course='sections' leads fibres from attachment area to attachment area, but aponeuroses are "
                "connected",
                "use course='auto' or 'straight', or leave the aponeuroses out",
            )
        areas = attachments or []
        by_role = [[area for area in areas if area.role == role] for role in ROLES]
        if aponeuroses is None:
            _check_roles(attachments, by_role)
            if self.course == "sections" or superficial is not None:
                return _passed_on(self._by_sections(muscle, areas, superficial), muscle)
        geometry = muscle.closed("and so no inside to keep fibres in")
        origin, insertion = _ends(geometry, by_role, aponeuroses)
        self.report_progress(0.2)
        fibres = straight_fibres(origin, insertion, self.n_fibres, self.resolution)
        volume = abs(signed_volume(geometry.points, geometry.triangles))
        filled = filled_share(fibres, origin, insertion, volume) if volume > 0.0 else 0.0
        self.report_progress(0.6)
        inside, departures = bend_inside(fibres, geometry.solids.into)
        leaving = float((departures > LEAVING * geometry.mean_edge).mean())
        suits = filled > LEAST_FILLED and leaving <= MOST_LEAVING
        if suits or self.course == "straight" or aponeuroses is not None:
            result = _straight(inside, departures > 0.0)
        else:
            result = self._by_sections(muscle, areas, superficial)
        add_arrays(result, fields={"FilledShare": filled, "LeavingShare": leaving})
        return _passed_on(result, muscle)

    def _by_sections(
        self, muscle: Surface, areas: list[AttachmentArea], superficial: vtkPolyData | None
    ) -> vtkPolyData:
        """Return the parallel template led through the muscle's sections."""
        template = FibreTemplateSource(n_fibres=self.n_fibres, resolution=self.resolution)()
        fitted = TemplateFitter()(template, muscle.data, areas, superficial)
        origin, insertion = (muscle.geometry.attached(areas, role) for role in ROLES)
        # Isolines run between areas that are apart.
        method = "plane" if len(np.intersect1d(origin, insertion)) else "harmonic"
        morphed = SliceMorpher(method=method)(fitted, muscle.data, areas, superficial)
        trimmed = FibreTrimmer()(morphed, muscle.data, areas)
        result: vtkPolyData = FibreSmoother()(trimmed, muscle.data, areas)
        return add_arrays(result, fields={"Course": "sections"})


def _straight(fibres: Floats, bent: Bools) -> vtkPolyData:
    """Return fibres (k, n, 3) as polylines with their arrays."""
    count, size = fibres.shape[:2]
    return add_arrays(
        polylines_from(Polylines(fibres.reshape(-1, 3), np.arange(count + 1) * size)),
        points={"t": np.tile(np.linspace(0.0, 1.0, size), count)},
        cells={"FibreId": np.arange(count), "Bent": bent.astype(np.int64)},
        fields={"Course": "straight"},
    )


def _passed_on(fibres: vtkPolyData, muscle: Surface) -> vtkPolyData:
    """Add to fibres the field arrays of their muscle that they do not have."""
    mine, others = fibres.GetFieldData(), muscle.data.GetFieldData()
    for number in range(others.GetNumberOfArrays()):
        if not mine.HasArray(others.GetArrayName(number)):
            mine.AddArray(others.GetAbstractArray(number))
    return fibres


def _check_roles(areas: list[AttachmentArea] | None, by_role: list[list[AttachmentArea]]) -> None:
    if areas is None:
        raise InputError("", "no attachments are connected", "connect them, or aponeuroses")
    for role, mine in zip(ROLES, by_role, strict=True):
        if not mine:
            problem = f"there is no area with the role {role!r}"
            raise InputError("attachments", problem, "add its landmarks, or connect aponeuroses")


def _ends(
    geometry: MuscleGeometry,
    by_role: list[list[AttachmentArea]],
    aponeuroses: list[Aponeurosis] | None,
) -> tuple[EndSurface, EndSurface]:
    """Return the surfaces on which fibres begin and end."""
    if aponeuroses is not None:
        origin, insertion = ([area.landmarks for area in mine] for mine in by_role)
        landmarks = (np.vstack(origin), np.vstack(insertion)) if all(by_role) else None
        return aponeurosis_surfaces(aponeuroses, geometry, "aponeuroses", landmarks)
    first, last = (
        attached_surface(mine, geometry, f"attachments: {role} area")
        for role, mine in zip(ROLES, by_role, strict=True)
    )
    return first, last
