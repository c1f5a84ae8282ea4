"""FibreMetrics: measure fibres."""

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres import measures
from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.core.mesh.polylines import end_directions, polyline_lengths
from vtkmuscle.core.mesh.smooth_normals import surface_angles
from vtkmuscle.core.mesh.surface import edge_lengths, half_edges, signed_volume
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, tree_of_deformed, triangle_tree
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import Polylines, add_arrays, cell_array
from vtkmuscle.data.muscle_geometry import ROUGHNESS, Surface
from vtkmuscle.data.paths import PathLines, add_path_arrays
from vtkmuscle.filters.base import Filter, OutputPort, Parameter, ports

#: Points of the centroid path: the shape (21, 3) of ``CentroidPath`` is part of the interface.
PATH_POINTS = 21


class FibreMetrics(Filter):
    """Measure length, strain, tortuosity, pennation and architecture.

    The inputs select the measures: strain needs ``RestLength`` (from FibreTransport), pennation a muscle.
    Pennation is the angle between a fibre's end segment and the muscle's surface, or the aponeurosis at the
    fibre's end: 0 along the surface, 90 degrees at right angles. The surface normal is continuous except at
    creases of more than 45 to 75 degrees; on a crease the angle is the mean over the adjacent faces. Fibre
    ends off the surface span an aponeurosis within the muscle, as in bipennate muscles.

    Parameters
    ----------
    fibres
        Polylines; with the cell array ``RestLength`` [mm] for strain.
    muscle
        The surface at the fibres' ends.
    paths
        The paths of the same fibres in the pose, from TautPaths: lengths and levers are added.
    architecture
        Measure the muscle: volume, line of action, centroid path, physiological cross-sectional area.

    Attributes
    ----------
    output
        The fibres with the cell arrays ``Length`` [mm], ``Tortuosity`` (length / distance of ends),
        ``Strain`` (length / rest length - 1, 0 for rest length 0), ``PennationOrigin`` and
        ``PennationInsertion`` [degrees, 0 to 90], and the field arrays ``LengthMean`` and ``LengthSD`` (of
        the population) [mm]. Architecture: the cell array ``LineAngle`` [degrees] between a fibre's chord
        and the line of action, and the field arrays ``MuscleVolume`` [mm^3], ``LineOfAction`` (3),
        ``CentroidPath`` (21, 3) [mm], ``PCSA`` (volume / mean length) and ``PCSALine`` (its part along the
        line of action) [mm^2]. Paths: the cell arrays ``PathLength``, ``PathRestLength`` and ``PathPoints``
        (3 n) [mm], ``Squeezed``, ``Sag``, levers and bows (:mod:`vtkmuscle.data.paths`).

    Raises
    ------
    ValueError
        If a value of ``RestLength`` is negative or not finite; with ``architecture``, if there is no
        closed muscle, or no fibre has a length; if the numbers of paths and fibres differ.

    References
    ----------
    Lieber, Friden 2000, *Functional and clinical significance of skeletal muscle architecture*,
    doi:10.1002/1097-4598(200011)23:11<1647::AID-MUS1>3.0.CO;2-M.

    Limitations
    -----------
    The physiological cross-sectional area assumes that fibres sample the muscle evenly; line of action and
    centroid path assume that fibres run the same way. Pennation is measured on the end segment, so the angle
    depends on the resolution of strongly curved fibres. Neighbouring ends along a line span no aponeurosis.
    Strain is a mean over a fibre.

    Examples
    --------
    >>> from vtkmodules.vtkFiltersSources import vtkLineSource
    >>> from vtkmuscle.filters import FibreMetrics
    >>> fibre = vtkLineSource(point1=(0, 0, 0), point2=(3, 4, 0)).update().output
    >>> FibreMetrics()(fibre).GetCellData().GetArray("Length").GetValue(0)
    5.0
    """

    architecture = Parameter(bool, default=False)

    fibres = ports.Lines()
    muscle = ports.Surface(optional=True)
    paths = ports.Paths(optional=True)
    output = OutputPort(vtkPolyData)

    _bent: TriangleTree | None = None

    def execute(self, fibres: Polylines, muscle: Surface | None, paths: PathLines | None) -> vtkPolyData:
        """Return the fibres with their measures."""
        points, offsets = fibres.points, fibres.offsets
        lengths = polyline_lengths(points, offsets)
        chords = np.linalg.norm(points[offsets[1:] - 1] - points[offsets[:-1]], axis=1)
        # A closed fibre has a huge ratio instead of infinity, a fibre without length has 1.
        floor = np.maximum(chords, np.finfo(np.float64).eps * lengths)
        ratio = np.divide(lengths, floor, out=np.ones_like(lengths), where=floor > 0)
        cells = {"Length": lengths, "Tortuosity": np.maximum(ratio, 1.0)}
        result = fibres.moved(points)
        if result.GetCellData().HasArray("RestLength"):
            cells["Strain"] = _strain(result, lengths)
        if muscle is not None:
            cells["PennationOrigin"], cells["PennationInsertion"] = self._pennation(fibres, muscle)
        add_arrays(result, cells=cells)
        if paths is not None:
            add_path_arrays(result, paths, "paths")
        if self.architecture:
            self._measure_muscle(result, fibres, lengths, muscle)
        return add_arrays(result, fields={"LengthMean": lengths.mean(), "LengthSD": lengths.std()})

    def _pennation(self, lines: Polylines, muscle: Surface) -> Floats:
        """Return the angles of fibre ends to the surface, or an inner aponeurosis, (2, k) [degrees]."""
        points, triangles = muscle.points, muscle.triangles
        # The hierarchy of the last frame is refitted: only the positions have changed.
        self._bent = tree_of_deformed(self._bent, points, triangles)
        ends = np.array([lines.points[lines.offsets[:-1]], lines.points[lines.offsets[1:] - 1]])
        faces, feet, away = self._bent.nearest(ends.reshape(-1, 3))
        if not triangle_normals(points, triangles[faces]).any(axis=1).all():  # some have no area
            triangles = triangles[triangle_normals(points, triangles).any(axis=1)]
            if not len(triangles):
                raise InputError("muscle", "all triangles are degenerate, so the surface has no normals")
            faces, feet, away = triangle_tree(points, triangles).nearest(ends.reshape(-1, 3))
        runs = np.array(end_directions(lines.points, lines.offsets))
        angles = surface_angles(points, triangles, faces, feet, runs.reshape(-1, 3)).reshape(2, -1)
        within = away > ROUGHNESS * edge_lengths(points, half_edges(triangles[faces])).mean()
        for own, end, run, off in zip(angles, ends, runs, within.reshape(2, -1), strict=True):
            if off.any():
                inner, sheet = measures.angles_to_inner_sheet(end, run, off)
                own[inner] = sheet
        return angles

    def _measure_muscle(
        self, result: vtkPolyData, lines: Polylines, lengths: Floats, muscle: Surface | None
    ) -> None:
        if muscle is None:
            raise InputError("", "architecture needs a muscle, but the port 'muscle' is not connected")
        muscle.closed("but architecture needs a closed surface")
        if not lengths.max() > 0.0:
            raise InputError("", "architecture needs fibres with a length, but all lengths are 0")
        direction, angles = measures.line_of_action(lines.points, lines.offsets)
        volume = abs(signed_volume(muscle.points, muscle.triangles))
        area, along = measures.physiological_cross_section(volume, lengths, angles)
        path = measures.centroid_path(lines.points, lines.offsets, PATH_POINTS)
        fields = {"MuscleVolume": volume, "LineOfAction": direction, "CentroidPath": path}
        fields |= {"PCSA": area, "PCSALine": along}
        add_arrays(result, cells={"LineAngle": angles}, fields=fields)


def _strain(fibres: vtkPolyData, lengths: Floats) -> Floats:
    rest = np.asarray(cell_array(fibres, "RestLength", "fibres"), dtype=np.float64)
    if rest.shape != lengths.shape:
        problem = f"the cell array 'RestLength' has the shape {rest.shape} for {len(lengths)} fibres"
        raise InputError("fibres", problem, "FibreTransport makes it")
    for fibre in np.flatnonzero(~(np.isfinite(rest) & (rest >= 0))):
        problem = f"the rest length of fibre {fibre} is {rest[fibre]}, but must be finite and not negative"
        raise InputError("fibres", problem)
    return np.divide(lengths - rest, rest, out=np.zeros_like(lengths), where=rest > 0)
