"""Reference that is made from the program: the command line, keys of a scene file, keys of a report."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import typer
from docutils import nodes
from filter_pages import table
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from typer.cli import get_docs_for_click

import vtkmuscle.scene.schema
from vtkmuscle.cli import app as command_line
from vtkmuscle.run.report_values import DEFINITIONS
from vtkmuscle.scene.writing import inline_toml


def write_command_line_page(app: Sphinx, config: Any) -> None:
    """Write the page of the command line by Typer's own tool."""
    command = typer.main.get_command(command_line)
    context = typer.Context(command, info_name="vtkmuscle")
    text = get_docs_for_click(obj=command, ctx=context, name="vtkmuscle", title="The command line")
    for name, one in command.commands.items():  # Typer cuts what a command does
        whole = " ".join((one.help or "").partition("\n\n")[0].split())
        text = re.sub(
            rf"^\* `{name}`: .*$", lambda _, n=name, w=whole: f"* `{n}`: {w}", text, flags=re.MULTILINE
        )
    page = Path(app.confdir) / "reference" / "command_line.md"
    if not page.exists() or page.read_text(encoding="utf-8") != text:
        page.write_text(text, encoding="utf-8")


class SceneTable(SphinxDirective):
    """``.. scene-table:: NAME``: the keys of a table of a scene file, from its model."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        known = vars(vtkmuscle.scene.schema)
        rows = []
        for name, field in known[self.arguments[0]].model_fields.items():
            plain = isinstance(field.default, str | int | float)
            default = f"``{inline_toml(field.default)}``" if plain else "none"
            example = f"``{inline_toml(field.examples[0])}``" if field.examples else ""
            default = "required" if field.is_required() else f"default: {default}"
            meaning = [" ".join(field.description.split()), *([f"Example: {example}"] if example else [])]
            rows.append([[f"``{name}``", default], meaning])
        lines = table(["key", "meaning"], [28, 72], rows)
        return self.parse_text_to_nodes("\n".join(lines))


class ReportTable(SphinxDirective):
    """``.. report-table::``: the keys of report.json, from the definitions that are part of each."""

    def run(self) -> list[nodes.Node]:
        rows = [[[f"``{key}``"], [meaning.replace("_p", r"\_p")]] for key, meaning in DEFINITIONS.items()]
        return self.parse_text_to_nodes("\n".join(table(["key", "meaning"], [30, 70], rows)))


def setup(app: Sphinx) -> dict[str, Any]:
    """Register all of it with Sphinx."""
    app.connect("config-inited", write_command_line_page)
    app.add_directive("scene-table", SceneTable)
    app.add_directive("report-table", ReportTable)
    return {"parallel_read_safe": True}
