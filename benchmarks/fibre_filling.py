"""How much of the muscles of scenes is farther than two spacings from any fibre, for every template.

    python benchmarks/fibre_filling.py SCENE... [--rst FOLDER]

A spacing is the root of the muscle's volume / the length of all of its 100 fibres. Figures are given twice:
with fibres that are not spread (``spreading=0``), and by default.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from how_right import Table
from scipy.spatial import cKDTree

from vtkmuscle import Scene
from vtkmuscle.core.mesh.polylines import evenly_spaced, polyline_lengths
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.template import KINDS
from vtkmuscle.data.arrays import polylines_of
from vtkmuscle.data.muscle_geometry import surface_of
from vtkmuscle.pipelines import decompose

#: Positions in a muscle, and places along a fibre.
SAMPLES, PLACES = 20_000, 200


def bare_share(muscle: Any, attachments: Any, **settings: Any) -> float:
    """Return the part of a muscle that is farther than two spacings from any fibre."""
    lines = polylines_of(decompose(muscle, attachments, **settings).update().output, "fibres")
    geometry = surface_of(muscle, "muscle").geometry
    dense = evenly_spaced(lines.points, lines.offsets, PLACES).reshape(-1, 3)
    apart = cKDTree(dense).query(geometry.samples(SAMPLES))[0]
    volume = abs(signed_volume(geometry.points, geometry.triangles))
    spacing = np.sqrt(volume / polyline_lengths(lines.points, lines.offsets).sum())
    return float((apart > 2.0 * spacing).mean())


def main() -> None:
    """Print the table, and write it where asked to."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", type=Path, nargs="+", metavar="SCENE", help="scene.toml")
    parser.add_argument("--rst", type=Path, metavar="FOLDER", help="write the table there as a CSV file")
    asked = parser.parse_args()
    table = Table("filling", ("muscle", *(f"{kind} [%]" for kind in KINDS)), [])
    for path in asked.scenes:
        scene = Scene.load(path)
        for name, muscle in scene.muscles.items():
            cells = []
            for kind in KINDS:
                given = muscle.surface, scene.attachments_data(name)
                both = (bare_share(*given, template=kind, **own) for own in ({"spreading": 0.0}, {}))
                cells.append(" / ".join(f"{100 * share:.1f}" for share in both))
            table.rows.append((name, *cells))
    print(table.text())
    if asked.rst:
        table.write(asked.rst)


if __name__ == "__main__":
    main()
