"""The reported numbers of muscles, measured on geometry."""

import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.fibres import measures as of_fibres
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.mesh.surface import extent, signed_volume
from vtkmuscle.core.types import SAME, Floats
from vtkmuscle.data import toml_table
from vtkmuscle.data.anatomy import PERSONAL, published
from vtkmuscle.data.arrays import cell_array, checked_surface, field_array, points_of, polylines_of
from vtkmuscle.data.muscle_geometry import surface_of
from vtkmuscle.filters.fibre_metrics import FibreMetrics
from vtkmuscle.io.fibre_table import muscle_summary, spread
from vtkmuscle.run.table import Table

#: Length at which sarcomeres of human muscle are strongest, to which dissections normalise [um]: Ward et al.
#: 2009, doi:10.1007/s11999-008-0594-8.
OPTIMAL_SARCOMERE = 2.7
#: Positions in the muscle by which the curve through its middle is found.
SAMPLES = 4096

#: Measures in reports and tables: architecture, with powers of length; columns of its table; fibres.
MEASURES = toml_table("vtkmuscle.run", "measures.toml")
FIBRE_MEASURES: Mapping[str, str] = MEASURES["fibres"]


def architecture_of(
    fibres: vtkPolyData, muscle: vtkPolyData, millimetres: float, hill: Mapping[str, float] | None = None,
    name: str = "", *, between_aponeuroses: bool = False,
) -> dict[str, Any]:  # fmt: skip
    """Return the architecture of a muscle at rest, JSON-able; see :data:`DEFINITIONS`.

    ``hill`` may have ``tendon_slack_length`` in the scene's unit and ``sarcomere_length`` in micrometres;
    ``name`` is looked up among published muscles; fibres may run between aponeuroses.
    """
    measures = FibreMetrics(architecture=True)(fibres, muscle)
    summary = muscle_summary(measures)
    result: dict[str, Any] = {}
    for array, (key, power) in MEASURES["architecture"].items():
        measured, scale = summary[array], millimetres**power
        result[key] = measured if isinstance(measured, list) else measured * scale
    tendon, sarcomere = ((hill or {}).get(key) for key in ("tendon_slack_length", "sarcomere_length"))
    ratio = published(name, "fibre_to_path")
    lines, geometry = polylines_of(fibres, "fibres"), surface_of(muscle, "muscle").geometry
    surface = geometry.points, geometry.triangles
    volume = abs(signed_volume(*surface))
    profile = of_fibres.area_profile(*surface, geometry.samples(SAMPLES), lines.points, lines.offsets)
    shares = of_fibres.TENDON_AREAS
    own, *ends = of_fibres.fascicles(profile, volume, lines.points, lines.offsets, shares=shares)
    whole = lines.lengths
    source, lengths, by_thickness = "estimate", own.lengths, own.lengths.mean()
    of_ends = [estimate.lengths for estimate in ends]
    if between_aponeuroses:
        source, lengths, of_ends = "aponeuroses", whole, [whole, whole]
        names = "PennationOrigin", "PennationInsertion"
        origin, insertion = (cell_array(measures, name, "fibres") for name in names)
        own, *ends = (of_fibres.Fascicles(whole, origin, insertion, each.volume) for each in (own, *ends))
    elif tendon is not None and tendon < whole.min():
        source, lengths = "scene", whole - tendon
        of_ends = [lengths, lengths]
    elif ratio is not None:
        source, lengths = "population", float(np.sqrt(ratio.low * ratio.high)) * whole
        of_ends = [ratio.low / PERSONAL * whole, ratio.high * PERSONAL * whole]
        ends = [own, own]
    square = millimetres**2
    areas = [each.cross_section(of) * square for each, of in zip(ends, of_ends, strict=True)]
    result |= {
        "tendon_from": source,
        "tendon_length_mm": float((whole - lengths).mean()) * millimetres,
        "fascicle_length_mm": spread(lengths * millimetres),
        "fascicle_length_range_mm": sorted(float(each.mean()) * millimetres for each in of_ends),
        "fascicle_length_by_thickness_mm": float(by_thickness) * millimetres,
        "fascicle_pennation_origin_deg": spread(own.origin_angles),
        "fascicle_pennation_insertion_deg": spread(own.insertion_angles),
        "tendon_volume_share": 1.0 - own.volume / volume if volume > 0.0 else 0.0,
        "volume_without_tendon_mm3": own.volume * millimetres**3,
        "pcsa_without_tendon_mm2": own.cross_section(lengths) * square,
        "pcsa_without_tendon_range_mm2": sorted(areas),
    }
    if sarcomere is not None:
        normalised = OPTIMAL_SARCOMERE / sarcomere * result["fascicle_length_mm"]["mean"]
        result["fascicle_length_normalised_mm"] = normalised
    return result


def architecture_table(muscles: Mapping[str, Mapping[str, Any]]) -> Table:
    """Return the architecture table of a report. A row per muscle with fibres."""
    columns = MEASURES["columns"]
    of = {name: muscle["architecture"] for name, muscle in muscles.items() if "architecture" in muscle}
    rows = ([name, *(values[key] for key in columns.values())] for name, values in of.items())
    means = ([each["mean"] if isinstance(each, Mapping) else each for each in row] for row in rows)
    return Table(("muscle", *columns), means)


#: Definitions of the numbers of a report by their keys; part of every report.
DEFINITIONS: Mapping[str, str] = toml_table("vtkmuscle.run", "definitions.toml")

_PACKAGES = ("vtkmuscle", "numpy", "scipy", "numba", "vtk", "pyvista")


def versions() -> dict[str, str]:
    """Return the versions of Python and packages. All packages with a part in the numbers."""
    about = {"python": platform.python_version(), "platform": platform.platform()}
    return about | {package: version_of(package) for package in _PACKAGES}


def version_of(package: str, otherwise: str = "unknown") -> str:
    """Return the version of a package."""
    try:
        return version(package)
    except PackageNotFoundError:  # e.g. VTK built from source, as in ParaView
        return otherwise


def fibres_at_rest(fibres: vtkPolyData, muscle: vtkPolyData, millimetres: float) -> dict[str, Any]:
    """Return the numbers of the fibres at rest. JSON-able; see :data:`DEFINITIONS`."""
    points = points_of(fibres)
    lines, geometry = polylines_of(fibres, "fibres"), surface_of(muscle, "muscle").geometry
    outside = np.maximum(solids_of(*checked_surface(muscle, "muscle")).distances(points), 0.0)
    inside = int((outside <= SAME * extent(geometry.points)).sum())
    volume = signed_volume(geometry.points, geometry.triangles)
    layout = of_fibres.arrangement(lines.points, lines.offsets, geometry.samples(SAMPLES), volume)
    angle = field_array(fibres, "SuperficialAngle")
    return {
        "fibres": fibres.GetNumberOfCells(),
        "points": len(points),
        "points_inside": inside,
        "points_outside": len(points) - inside,
        "farthest_outside_mm": float(outside.max()) * millimetres,
        "crossing_share": layout.crossing,
        "hooked_share": layout.hooked,
        "turning_p95_deg": layout.turning,
        "bare_share": layout.bare,
        **({} if angle is None else {"superficial_angle_degrees": float(angle[0])}),
    }


def measures_of_fibres(columns: Mapping[str, Floats], millimetres: float) -> dict[str, Floats]:
    """Return measures (k,) of FibreMetrics by their names in reports, where the unit is in the name."""
    names = {array: name for array, name in FIBRE_MEASURES.items() if array in columns}
    scales = {name: millimetres if name.endswith("_mm") else 1.0 for name in names.values()}
    return {name: scales[name] * columns[array] for array, name in names.items()}
