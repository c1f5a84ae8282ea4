"""Make docs/images/report.png: the page of the phantom hip's run, as Chromium shows it."""

import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from vtkmuscle import Scene, phantoms

PICTURE = Path(__file__).parent / "images" / "report.png"

with TemporaryDirectory() as folder:
    result = Scene.from_phantom(phantoms.hip()).run(figures=False)
    page = result.write_report(Path(folder) / "report.html")
    subprocess.run(
        [
            shutil.which("chromium") or "google-chrome",
            *("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
            *("--window-size=1280,2100", "--hide-scrollbars", "--virtual-time-budget=20000"),
            f"--screenshot={PICTURE}",
            page.as_uri(),
        ],
        check=True,
    )
with Image.open(PICTURE) as picture:
    picture.convert("RGB").quantize(200).save(PICTURE, optimize=True)
