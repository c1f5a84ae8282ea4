"""Docstrings as pages: bars and DOIs in them, what is left out, and warnings of the gallery's examples."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any
from urllib.parse import quote

from PIL import Image, ImageChops, ImageOps
from sphinx.application import Sphinx

_DOI = re.compile(r"(?<![\w/`<])doi:(10\.\d{4,9}/[-._;()/:<>a-zA-Z0-9]*[a-zA-Z0-9])")
_filters_before: list[Any] = []
#: The gallery's examples by the folder of each, in the order in which a reader may want them.
_EXAMPLES = {
    "first": "quickstart papers_chain two_deformers hip landmark_ring wrong_muscle compare model",
    "joints": "moment_arm published_range moment_arms_chain places two_joints knee joint_centre gait_cycle "
    "opensim_model",
    "fibres": (
        "fibres_2012 fibre_templates own_template pennate_block pennate_belly surfaces_alone "
        "superficial_fibres fibre_ends"
    ),
    "program": "branching_pipeline time_slider animated_hip fixed_points iliacus",
}


def place_in_gallery(filename: str) -> int:
    """Return where an example comes in the gallery."""
    return " ".join(_EXAMPLES.values()).split().index(filename.removeprefix("plot_").removesuffix(".py"))


def place_of_group(folder: str) -> int:
    """Return where a group of examples comes, by its folder."""
    return list(_EXAMPLES).index(Path(folder).name)


def fill_tiles(app: Sphinx, _: Any) -> None:
    """Cut the white rims off the gallery's small pictures, so that what they show fills its tile."""
    for path in (Path(app.confdir) / "gallery").glob("*/images/thumb/*.png"):
        with Image.open(path) as picture:
            plain = picture.convert("RGB")
        box = ImageChops.difference(plain, Image.new("RGB", plain.size, "white")).getbbox()
        if box is not None:
            ImageOps.pad(plain.crop(box), plain.size, Image.Resampling.LANCZOS, "white").save(path)


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


def link_dois(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Make links of the DOIs in docstrings."""
    lines[:] = [_DOI.sub(_linked, line) for line in lines]


def _linked(doi: re.Match[str]) -> str:
    shown = doi[1].replace("<", r"\<").replace(">", r"\>")
    return f"`doi:{shown} <https://doi.org/{quote(doi[1], safe='/:;()')}>`__"


def setup(app: Sphinx) -> dict[str, Any]:
    """Register all of it with Sphinx."""
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("env-updated", fill_tiles)
    app.connect("autodoc-skip-member", skip_imported)
    app.connect("autodoc-process-docstring", escape_bars, priority=400)
    app.connect("autodoc-process-docstring", link_dois, priority=410)
    return {"parallel_read_safe": True}
