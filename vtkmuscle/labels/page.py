"""The page of a scene that was drawn up: a picture, its surfaces, and each guess with how sure it is."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape
from io import BytesIO
from pathlib import Path

import pyvista
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.data.arrays import blocks_of, checked_surface, field_array
from vtkmuscle.data.attachments import attachments_from
from vtkmuscle.io.writing import write_text
from vtkmuscle.labels.draft import Draft
from vtkmuscle.labels.guesses import LOOK, table_of
from vtkmuscle.plotting import can_render
from vtkmuscle.plotting.studio import x_server_warning_off

_STYLE = (
    "body{font:15px sans-serif;max-width:70em;margin:2em auto;padding:0 1em}table{border-collapse:collapse}"
    "td,th{text-align:left;padding:.2em .8em .2em 0;border-bottom:1px solid #ddd;vertical-align:top}"
    "img{max-width:100%}.look{background:#fff0d0}"
)


def write_page(draft: Draft, out: Path) -> Path:
    """Write guesses.html, with a picture where pictures can be made, and return the page."""
    parts = [f"<h1>{escape(draft.name)}: what was made, and what was guessed</h1>"]
    if can_render() is None:
        with x_server_warning_off():
            picture = b64encode(draw(draft)).decode()
        parts.append(
            "<p>Seen from the front, and from the right. Rings are areas of attachment: blue where they are "
            "landmarks, orange where they are estimated.</p>"
            f"<img src='data:image/png;base64,{picture}' alt='the scene at rest'>"
        )
    rows = [["structure", "kind", "triangles", "volume [cm³]", "against the label", "95 % within"]]
    for kind, surfaces in (("bone", draft.bones), ("muscle", draft.muscles)):
        rows += [[name, kind, *_figures(surface)] for name, surface in surfaces.items()]
    parts += ["<h2>Surfaces</h2>", _table(rows), "<h2>Guesses</h2>"]
    parts.append(f"<p>The least sure first; those below {LOOK} want to be looked at.</p>")
    parts.append(_table(table_of(draft.guesses), marked=True))
    head = f"<!doctype html><meta charset='utf-8'><title>{escape(draft.name)}</title><style>{_STYLE}</style>"
    write_text(out / "guesses.html", "\n".join([head, *parts]) + "\n")
    return out / "guesses.html"


def draw(draft: Draft) -> bytes:
    """Return a PNG picture of a scene: bones, muscles that one sees through, and rings around the areas."""
    plotter = pyvista.Plotter(off_screen=True, shape=(1, 2), window_size=(1600, 1000), border=False)
    sign = 1.0 if draft.frame == "LPS" else -1.0
    for number, towards in enumerate(((0.0, -sign, 0.0), (-sign, 0.0, 0.0))):
        plotter.subplot(0, number)
        for bone in draft.bones.values():
            plotter.add_mesh(bone, color="#e8dcc2", smooth_shading=True)
        for name, muscle in draft.muscles.items():
            plotter.add_mesh(muscle, color="#b4443c", opacity=0.55, smooth_shading=True)
            rings = blocks_of(attachments_from(draft.areas[name]))
            for area, (_, ring) in zip(draft.areas[name], rings, strict=True):
                colour = "#e08a00" if area.estimated else "#1f5fbf"
                plotter.add_mesh(ring, color=colour, line_width=6, render_lines_as_tubes=True)
        plotter.view_vector(towards, viewup=(0.0, 0.0, 1.0))
        plotter.camera.zoom(1.4)
    plotter.screenshot(picture := BytesIO())
    plotter.close()
    return picture.getvalue()


def _figures(surface: vtkPolyData) -> list[str]:
    """Return the triangles and the volume of a surface, and how near it is to its label, if it has one."""
    points, triangles = checked_surface(surface, "surface")
    error, away = field_array(surface, "VolumeError"), field_array(surface, "BoundaryDistance")
    against = "" if error is None else f"{100.0 * error[0]:+.2f} %"
    within = "" if away is None else f"{away[1]:.2f} mm"
    return [str(len(triangles)), f"{signed_volume(points, triangles) / 1000.0:.1f}", against, within]


def _table(rows: Sequence[Sequence[str]], *, marked: bool = False) -> str:
    """Return a table in HTML; marked where the number in the first column is small."""
    lines = ["<table>", f"<tr>{''.join(f'<th>{escape(cell)}</th>' for cell in rows[0])}</tr>"]
    for row in rows[1:]:
        look = " class='look'" if marked and float(row[0]) < LOOK else ""
        lines.append(f"<tr{look}>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>")
    return "\n".join([*lines, "</table>"])
