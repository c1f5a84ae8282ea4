"""Pages of filters, from what they declare: a list of all, and of each its ports and parameters in groups."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import vtkmuscle.filters
from vtkmuscle.filters.base.docstrings import described, split_docstring

#: The parameters of a filter that has many, in groups by what they are about.
GROUPS = {
    "PBDDeformer": {
        "Set these first": ["quality", "bone_clearance", "checkpoint_memory"],
        "What a quality sets": [
            "iterations",
            "solved_triangles",
            "collision",
            "prediction",
            "signed_angles",
            "order",
            "anisotropy",
            "finish",
        ],
        "Stiffness": ["stiffness", "shape_stiffness", "volume_stiffness"],
        "The report": ["measure_shape", "measure_penetration"],
        "As published": [
            "velocity_kept",
            "dt",
            "external_force",
            "n_voxels",
            "n_voxels_per_axis",
            "bone_push",
            "contact_velocity",
        ],
    }
}


def write_filter_page(app: Sphinx, config: Any) -> None:
    """Write the page that lists all filters, for autosummary to find it: no list is kept by hand."""
    page = Path(app.confdir) / "reference" / "api" / "filters.rst"
    lines = ["All filters", "===========", "", ".. currentmodule:: vtkmuscle.filters", "", ".. autosummary::"]
    lines += ["   :toctree: generated", "   :template: autosummary/filter.rst", ""]
    lines += [f"   {kind.__name__}" for kind in vtkmuscle.filters.filter_classes()]
    text = "\n".join([*lines, ""])
    if not page.exists() or page.read_text(encoding="utf-8") != text:
        page.write_text(text, encoding="utf-8")


def is_filter(what: str, obj: Any) -> bool:
    """Return whether an object that autodoc shows is a filter with declarations."""
    return what == "class" and obj in vtkmuscle.filters.filter_classes()


def shorten_signature(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, signature: str, returned: str
) -> tuple[str, str] | None:
    """Show a filter with its ports alone: the parameters are in a table below."""
    if not is_filter(what, obj):
        return None
    ports = [f"{port.name}=None" for port in obj.input_ports]
    return f"({', '.join(['*', *ports, '**parameters'])})", ""


def keep_prose(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Take ports and parameters out of a filter's docstring; numpydoc drops sections unknown to it."""
    if is_filter(what, obj):
        _, own = split_docstring(inspect.cleandoc("\n".join(lines)))
        head, _ = split_docstring("\n".join(lines))
        kept = [part for part in sections(own) if part[0] not in ("Parameters", "Notes")]
        lines[:] = [*head.splitlines(), ""]
        for title, body in sorted(kept, key=lambda part: part[0] != "Limitations"):
            heading = [".. rubric:: Limitations", ""] if title == "Limitations" else [title, "-" * len(title)]
            lines += [*heading, *body, ""]


def sections(text: str) -> list[tuple[str, list[str]]]:
    """Return the sections of a numpydoc docstring: their titles and lines."""
    found: list[tuple[str, list[str]]] = []
    lines = text.splitlines()
    for i, line in enumerate(lines):
        if line and set(line) == {"-"} and i and len(line) == len(lines[i - 1]):
            if found:
                found[-1][1].pop()  # the title was taken for a line of the section before
            found.append((lines[i - 1], []))
        elif found:
            found[-1][1].append(line)
    return found


def insert_tables(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Put ports and parameters after the first paragraph, where a reader looks for them."""
    if is_filter(what, obj):
        text = "\n".join(lines).strip("\n").splitlines()
        end = text.index("") if "" in text else len(text)
        described_at_length = text[end:] and not text[end:][1].startswith((":", ".."))
        rest = ["", ".. rubric:: Description", *text[end:]] if described_at_length else text[end:]
        lines[:] = [*text[:end], "", *port_table(obj), *parameter_tables(obj), *rest]


def port_table(kind: Any) -> list[str]:
    """Return the ports of a filter as a table."""
    rows = []
    for number, port in enumerate(kind.input_ports):
        optional = ", optional" if port.optional else ""
        rows.append([[f"``{port.name}``", f"input {number}{optional}", port.type_name], [port.doc]])
    for number, port in enumerate(kind.output_ports):
        rows.append([[f"``{port.name}``", f"output {number}", port.type_name], [port.doc]])
    return [".. rubric:: Ports", "", *table(["port", "content"], [30, 70], rows)]


def parameter_tables(kind: Any) -> list[str]:
    """Return the parameters of a filter as tables, one per group."""
    declared = kind.parameter_declarations
    if not declared:
        return []
    groups = GROUPS.get(kind.__name__, {"Parameters": list(declared)})
    named = [name for names in groups.values() for name in names]
    if sorted(named) != sorted(declared):
        raise ValueError(f"{kind.__name__}: GROUPS in {__file__} is to name each parameter once")
    lines = []
    for title, names in groups.items():
        rows = []
        for name in names:
            one = declared[name]
            rows.append([[f"``{name}``", f"default ``{one.default!r}``", one.allowed], [described(one)]])
        heading = title if title == "Parameters" else f"Parameters: {title[0].lower()}{title[1:]}"
        lines += [f".. rubric:: {heading}", "", *table(["parameter", "effect"], [30, 70], rows)]
    return lines


def table(head: list[str], widths: list[int], rows: list[list[list[str]]]) -> list[str]:
    """Return a table in reStructuredText; a cell is a list of lines."""
    lines = [".. list-table::", "   :header-rows: 1", f"   :widths: {' '.join(map(str, widths))}", ""]
    for row in [[[word] for word in head], *rows]:
        for i, cell in enumerate(row):
            begin = f"   {'* -' if i == 0 else '  -'} "
            bar = "| " if len(cell) > 1 else ""
            for j, line in enumerate(cell):
                lines.append(f"{begin if j == 0 else ' ' * len(begin)}{bar}{' '.join(line.split())}")
    return [*lines, ""]


class FilterTable(SphinxDirective):
    """``.. filter-table::``: all filters with what they take and give."""

    def run(self) -> list[nodes.Node]:
        rows = []
        for kind in vtkmuscle.filters.filter_classes():
            summary = inspect.getdoc(kind).split("\n\n")[0]
            inputs = ", ".join(f"``{p.name}``" + (" (opt.)" if p.optional else "") for p in kind.input_ports)
            outputs = ", ".join(port.type_name for port in kind.output_ports)
            name = f":class:`~vtkmuscle.filters.{kind.__name__}`"
            rows.append([[name], [summary], [f"{inputs or 'nothing'} → {outputs}"]])
        lines = table(["filter", "job", "ports"], [25, 42, 33], rows)
        return self.parse_text_to_nodes("\n".join(lines))


def setup(app: Sphinx) -> dict[str, Any]:
    """Register all of it with Sphinx."""
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("config-inited", write_filter_page)
    app.connect("autodoc-process-signature", shorten_signature)
    app.connect("autodoc-process-docstring", keep_prose, priority=300)
    app.connect("autodoc-process-docstring", insert_tables, priority=600)
    app.add_directive("filter-table", FilterTable)
    return {"parallel_read_safe": True}
