"""Pictures of pages, made by the build: by running the code of the page."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.util import logging

from vtkmuscle.plotting import can_render

log = logging.getLogger(__name__)
#: Pages whose code draws their pictures, into pictures/NAME.
PAGES = [
    "start/first_scene.rst",
    *(f"how_to/{page}.rst" for page in ("labels", "slicer", "model_and_mri", "critical")),
]
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
#: WebGL without a graphics card; the page's clock runs on until it has drawn all.
FLAGS = [
    "--headless=new",
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--hide-scrollbars",
    "--window-size=1100,1250",
    "--virtual-time-budget=15000",
]


def make_pictures(app: Sphinx) -> None:
    """Run the pages, each in a process and a folder of its own."""
    docs = Path(app.confdir)
    if not app.config.plot_pages or can_render() is not None:
        app.config.suppress_warnings.append("image.not_readable")
        log.info("the pictures of pages are not made")
        return
    for page in PAGES:
        folder = docs / "pictures" / Path(page).stem
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        log.info("running %s", page)
        script = Path(__file__).with_name("page_examples.py")
        done = subprocess.run(
            [sys.executable, "-W", "error", str(script), str(docs / page)],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise RuntimeError(f"{page}: its code fails\n{done.stderr}")
        for report in folder.glob("*/report.html"):
            photograph(app, report)


def photograph(app: Sphinx, page: Path) -> None:
    """Write a picture of a page beside it, as Chromium shows it."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        app.config.suppress_warnings.append("image.not_readable")
        log.info("there is no Chromium: no picture of %s", page.name)
        return
    subprocess.run(
        [browser, *FLAGS, f"--screenshot={page.with_suffix('.png')}", page.as_uri()],
        capture_output=True,
        timeout=300,
        check=True,
    )


def setup(app: Sphinx) -> dict[str, Any]:
    """Make the pictures before pages are read; ``-D plot_pages=0`` leaves them as they are."""
    app.add_config_value("plot_pages", default=True, rebuild="", types=[bool])
    app.connect("builder-inited", make_pictures)
    return {"parallel_read_safe": True}
