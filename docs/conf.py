"""Sphinx configuration: ``python -m sphinx -W -b html docs docs/_build/html`` from the repository's root."""

from __future__ import annotations

import os
import sys
from pathlib import Path

# Pictures are rendered without a window. Set before PyVista is imported.
os.environ["PYVISTA_OFF_SCREEN"] = "true"
os.environ["PYVISTA_BUILDING_GALLERY"] = "true"

import pyvista
from pyvista.plotting.utilities.sphinx_gallery import Scraper

import vtkmuscle
from vtkmuscle.plotting import can_render

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "vtkmuscle"
author = "The vtkmuscle developers"
project_copyright = author
version = release = vtkmuscle.__version__

extensions = [
    "sphinx_gallery.gen_gallery",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_design",
    "myst_parser",  # for the page that Typer writes
    "numpydoc",
    "check_pages",
    "docstrings",
    "filter_pages",
    "generated_tables",
    "mathml",
    "page_pictures",
]

templates_path = ["_templates"]
exclude_patterns = ["_build", "**.ipynb", "gallery/**.md5", "pictures"]
html_theme = "pydata_sphinx_theme"
html_title = "vtkmuscle"
html_theme_options = {"show_prev_next": False, "show_toc_level": 2, "header_links_before_dropdown": 6}
html_sidebars = {"index": []}  # pages without others beside them have no use for it
html_static_path = ["_static"]
html_show_sourcelink = False
smartquotes_action = "qe"  # "--out" is an option, not a dash
html_css_files = ["vtkmuscle.css"]
html_math_renderer = "mathml"
html_context = {"default_mode": "auto"}

autosummary_generate = True
autodoc_typehints = "none"
autodoc_member_order = "bysource"
# The class docstrings say all; VTK's inherited methods are hundreds.
numpydoc_show_class_members = False
numpydoc_show_inherited_class_members = False
numpydoc_class_members_toctree = False

pyvista.OFF_SCREEN = True
pyvista.BUILDING_GALLERY = True
pyvista.set_plot_theme("document")
pyvista.global_theme.window_size = [900, 650]

no_pictures = can_render()
if no_pictures is not None:
    sys.stderr.write(f"The examples are shown without being run: {no_pictures}\n")

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"plot_.*\.py",
    "ignore_pattern": r"(^|/)(?!plot_)\w+\.py$",
    "image_scrapers": (Scraper(), "matplotlib"),
    "subsection_order": "docstrings.place_of_group",
    "within_subsection_order": "docstrings.place_in_gallery",
    "thumbnail_size": (480, 336),
    "reset_modules": ("docstrings.warnings_are_errors",),
    "reset_modules_order": "both",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_signature": False,
    "write_computation_times": False,
    "remove_config_comments": True,
    "min_reported_time": 600,
    "plot_gallery": str(no_pictures is None),
}
