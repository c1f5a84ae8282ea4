"""Mathematics as MathML, which browsers draw themselves: no script, no font and no network is needed."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx


def mathml(formula: str, display: str = "inline") -> str:
    """Return a formula in MathML; a bar is a bracket, not an operator with space around it."""
    bar = '<mo stretchy="false" lspace="0" rspace="0">|</mo>'
    return re.sub(r"<mo[^>]*>(?:&#x0007C;|&#x2223;|\|)</mo>", bar, convert(formula, display=display))


def visit_inline(translator: Any, node: nodes.math) -> None:
    """Write a formula within a line."""
    translator.body.append(mathml(node.astext()))
    raise nodes.SkipNode


def visit_block(translator: Any, node: nodes.math_block) -> None:
    """Write a formula in a line of its own, which scrolls where it is wider than the page."""
    translator.body.append(f'<div class="math-block">{mathml(node.astext(), display="block")}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the renderer; ``html_math_renderer = "mathml"`` takes it."""
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
