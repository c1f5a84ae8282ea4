"""The page of a drafted scene: picture, surfaces and guesses."""

from __future__ import annotations

from base64 import b64encode
from io import BytesIO
from pathlib import Path

import pyvista
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.data.arrays import blocks_of, checked_surface, field_array
from vtkmuscle.data.attachments import attachments_from
from vtkmuscle.labels.draft import Draft
from vtkmuscle.labels.guesses import LOOK, table_of
from vtkmuscle.plotting import can_render
from vtkmuscle.plotting.studio import x_server_warning_off
from vtkmuscle.report.sections import Cell, Section
from vtkmuscle.report.sections import write_page as page_of_sections


def write_page(draft: Draft, out: Path) -> Path:
    """Write guesses.html, with a picture if rendering works; return the page."""
    sections = []
    if can_render() is None:
        with x_server_warning_off():
            picture = b64encode(draw(draft)).decode()
        words = "Front and right view. Rings are attachment areas: blue from landmarks, orange estimated."
        sections.append(Section("The scene at rest", pictures=[(words, picture)]))
    rows = [("structure", "kind", "triangles", "volume [cm³]", "against the label", "95 % within")]
    for kind, surfaces in (("bone", draft.bones), ("muscle", draft.muscles)):
        rows += [(name, kind, *_figures(surface)) for name, surface in surfaces.items()]
    head, *guesses = table_of(draft.guesses)
    marked: list[list[str | Cell]] = [
        [confidence, Cell(what, "look" if float(confidence) < LOOK else ""), *rest]
        for confidence, what, *rest in guesses
    ]
    note = f"Lowest confidence first. Check the marked guesses, with a confidence below {LOOK}."
    sections += [Section("Surfaces", rows=rows), Section("Guesses", note, [head, *marked], words=True)]
    lead = "Surfaces and guesses of the drafted scene."
    return page_of_sections(out / "guesses.html", draft.name, "draft", lead, sections)


def draw(draft: Draft) -> bytes:
    """Return a PNG picture: bones, transparent muscles, and rings around areas."""
    plotter = pyvista.Plotter(off_screen=True, shape=(1, 2), window_size=(1600, 1000), border=False)
    sign = 1.0 if draft.frame == "LPS" else -1.0
    for number, towards in enumerate(((0.0, -sign, 0.0), (-sign, 0.0, 0.0))):
        plotter.subplot(0, number)
        for bone in draft.bones.values():
            plotter.add_mesh(bone, color="#e8dcc2", smooth_shading=True)
        for name, muscle in draft.muscles.items():
            plotter.add_mesh(muscle, color="#b4443c", opacity=0.55, smooth_shading=True)
            areas = draft.areas.get(name, [])
            for area, (_, ring) in zip(areas, blocks_of(attachments_from(areas)), strict=True):
                colour = "#e08a00" if area.estimated else "#1f5fbf"
                plotter.add_mesh(ring, color=colour, line_width=6, render_lines_as_tubes=True)
        plotter.view_vector(towards, viewup=(0.0, 0.0, 1.0))
        plotter.camera.zoom(1.4)
    plotter.screenshot(picture := BytesIO())
    plotter.close()
    return picture.getvalue()


def _figures(surface: vtkPolyData) -> tuple[str, str, str, str]:
    """Return a surface's triangles, volume and accuracy as text."""
    points, triangles = checked_surface(surface, "surface")
    error, distances = field_array(surface, "VolumeError"), field_array(surface, "BoundaryDistance")
    against = "" if error is None else f"{100.0 * error[0]:+.2f} %"
    within = "" if distances is None else f"{distances[1]:.2f} mm"
    return str(len(triangles)), f"{signed_volume(points, triangles) / 1000.0:.1f}", against, within
