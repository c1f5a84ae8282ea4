"""Finished settings on disk, so that none is run again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from vtkmuscle.io.parts import Part, Parts
from vtkmuscle.io.writing import check_no_links
from vtkmuscle.run.store.keys import code_digest, digest_of
from vtkmuscle.scene.data import SceneData
from vtkmuscle.tradeoff.trial import Trial


class Records:
    """A folder with one file per finished setting: its figures, or the trials of a reference.

    A file's name is a digest of the scene, the frames that are compared, the source of the package and the
    setting, so that a change of any of them runs it anew and the old file stays for what it was.

    Parameters
    ----------
    folder : Path
        Made where it does not exist.
    scene : SceneData
        What is run.
    compared : sequence of int
        Numbers of the frames that are compared.
    fresh : bool, optional
        Run settings again that are finished.
    """

    def __init__(
        self, folder: Path, scene: SceneData, compared: Sequence[int], *, fresh: bool = False
    ) -> None:
        check_no_links(folder)
        self._parts = Parts(folder)
        self._what = [digest_of(scene), list(compared), code_digest()]
        self._fresh = fresh
        self._made: set[str] = set()

    def name(self, key: Any) -> str:
        """Return the name of the part of a JSON-able key."""
        text = json.dumps([self._what, key], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def figures(self, key: Any, make: Callable[[], dict[str, Any]]) -> Mapping[str, Any]:
        """Return the figures that are kept of a key, made and kept where there are none."""
        found: Mapping[str, Any] = self._part(key, lambda: Part({"key": key, "figures": make()})).facts[
            "figures"
        ]
        return found

    def trial(self, key: Any, make: Callable[[], Trial]) -> Trial:
        """Return the trial that is kept of a key, made and kept where there is none."""

        def part() -> Part:
            facts = dict(vars(make()))
            arrays = {name: facts.pop(name) for name in ("points", "lengths")}
            return Part(facts, arrays)

        kept = self._part(key, part)
        return Trial(kept.arrays["points"], kept.arrays["lengths"], **kept.facts)

    def _part(self, key: Any, make: Callable[[], Part]) -> Part:
        name = self.name(key)
        if self._fresh and name not in self._made:
            self._parts.path(name).unlink(missing_ok=True)
        self._made.add(name)
        return self._parts.made(name, name, make)
