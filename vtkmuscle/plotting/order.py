"""A figure to be drawn, here or by a process of its own: which, and of what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import vtkmuscle.plotting

if TYPE_CHECKING:
    from pathlib import Path

    from vtkmuscle.data.drawn_bones import DrawnBones
    from vtkmuscle.plotting.studio import Studio


@dataclass(frozen=True, eq=False)
class FigureOrder:
    """A figure to be drawn; making one loads nothing that draws.

    Attributes
    ----------
    name : str
        Of the file, without its suffix.
    plot : str
        The function of :mod:`vtkmuscle.plotting` that makes it.
    given : mapping of str to object
        Its arguments, without the bones and the studio.
    rendered : bool
        Whether it takes these, too.
    """

    name: str
    plot: str
    given: Mapping[str, Any]
    rendered: bool = False

    def write(
        self, folder: Path, bones: DrawnBones, studio: Studio, form: str = "png", dpi: float = 150.0
    ) -> Path:
        """Draw it, and return the file in a folder, which is made where it does not exist."""
        from vtkmuscle.plotting.sheets import save_figure  # noqa: PLC0415 -- loads matplotlib

        folder.mkdir(parents=True, exist_ok=True)
        scene = {"bones": bones, "studio": studio} if self.rendered else {}
        path = folder / f"{self.name}.{form}"
        save_figure(getattr(vtkmuscle.plotting, self.plot)(**self.given, **scene), path, dpi)
        return path
