"""What these docs need beyond Sphinx: kernels shown as functions, bars in docstrings, lists of filters."""

from __future__ import annotations

import importlib
import json
import pkgutil
import re
import warnings
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import vtkmuscle.core
import vtkmuscle.filters
import vtkmuscle.scene.schema


def show_kernels_as_functions(app: Sphinx) -> None:
    """Put the Python function in the place of each compiled kernel, for autodoc knows only functions.

    Runs after the gallery (which calls the kernels) and before autosummary (which lists them).
    """
    for info in pkgutil.walk_packages(vtkmuscle.core.__path__, "vtkmuscle.core."):
        module = importlib.import_module(info.name)
        for name, value in list(vars(module).items()):
            if hasattr(value, "py_func"):
                setattr(module, name, value.py_func)


_filters_before: list[Any] = []


def warnings_are_errors(gallery_conf: dict[str, Any], fname: str, when: str) -> None:
    """Make a warning of an example an error, and of nothing else; called before and after each."""
    if not str(fname).endswith(".py"):
        return
    if when == "before":
        _filters_before[:] = warnings.filters
        warnings.simplefilter("error")
    else:
        warnings.filters[:] = _filters_before


def skip_imported(app: Sphinx, what: str, name: str, obj: Any, skip: bool, options: Any) -> bool | None:
    """Leave out of a module's page what it only imports; autodoc trips over compiled classes."""
    module = getattr(obj, "__module__", None)
    foreign = isinstance(module, str) and not module.startswith("vtkmuscle")
    return True if what == "module" and foreign else None


def escape_bars(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Keep absolute values in docstrings, |x|, from being read as reStructuredText substitutions."""
    for i, line in enumerate(lines):
        if "|" in line and not line.lstrip().startswith((">>>", "...")):
            parts = re.split(r"(``.*?``|:math:`.*?`)", line)
            parts[::2] = [part.replace("|", r"\|") for part in parts[::2]]
            lines[i] = "".join(parts)


def write_filter_page(app: Sphinx, config: Any) -> None:
    """Write the page that lists all filters, for autosummary to find it: no list is kept by hand."""
    page = Path(app.confdir) / "reference" / "api" / "filters.rst"
    lines = ["All filters", "===========", "", ".. currentmodule:: vtkmuscle.filters", "", ".. autosummary::"]
    lines += ["   :toctree: generated", "   :template: autosummary/filter.rst", ""]
    lines += [f"   {kind.__name__}" for kind in vtkmuscle.filters.filter_classes()]
    text = "\n".join([*lines, ""])
    if not page.exists() or page.read_text(encoding="utf-8") != text:
        page.write_text(text, encoding="utf-8")


class FilterTable(SphinxDirective):
    """``.. filter-table::``: all filters with their ports, from what they declare."""

    def run(self) -> list[nodes.Node]:
        lines = [
            ".. list-table::",
            "   :header-rows: 1",
            "   :widths: 22 39 39",
            "",
            "   * - filter",
            "     - input ports",
            "     - output",
        ]
        for filter_class in vtkmuscle.filters.filter_classes():
            lines += [f"   * - :class:`~vtkmuscle.filters.{filter_class.__name__}`"]
            lines += self._cell([self._input(i, port) for i, port in enumerate(filter_class.input_ports)])
            lines += self._cell([f"{port.type_name}: {port.doc}" for port in filter_class.output_ports])
        return self.parse_text_to_nodes("\n".join(lines))

    @staticmethod
    def _input(number: int, port: Any) -> str:
        optional = " (optional)" if port.optional else ""
        return f"{number} ``{port.name}``{optional}, {port.type_name}: {port.doc}"

    @staticmethod
    def _cell(entries: list[str]) -> list[str]:
        first, *others = entries or ["none"]
        lines = [f"     - | {first}"]
        return lines + [f"       | {entry}" for entry in others]


class SceneTable(SphinxDirective):
    """``.. scene-table:: NAME``: the keys of a table of a scene file, from its model."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        lines = [".. list-table::", "   :header-rows: 1", "   :widths: 22 58 20", ""]
        lines += ["   * - key", "     - what", "     - default"]
        known = {**vars(vtkmuscle.scene.joint_schema), **vars(vtkmuscle.scene.schema)}
        for name, field in known[self.arguments[0]].model_fields.items():
            plain = isinstance(field.default, str | bool)
            default = f"``{json.dumps(field.default)}``" if plain else "none"
            lines += [f"   * - ``{name}``", f"     - {field.description}"]
            lines += ["     - required" if field.is_required() else f"     - {default}"]
        return self.parse_text_to_nodes("\n".join(lines))


def setup(app: Sphinx) -> dict[str, Any]:
    """Register all of it with Sphinx."""
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("config-inited", write_filter_page)
    app.connect("builder-inited", show_kernels_as_functions)
    app.connect("autodoc-skip-member", skip_imported)
    app.connect("autodoc-process-docstring", escape_bars, priority=400)
    app.add_directive("filter-table", FilterTable)
    app.add_directive("scene-table", SceneTable)
    return {"parallel_read_safe": True}
