"""Finished settings on disk, so that none is run again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import vtkmuscle
from vtkmuscle.data.arrays import points_of, triangles_of
from vtkmuscle.io.writing import replacing, write_text
from vtkmuscle.scene.data import SceneData
from vtkmuscle.tradeoff.settings import Setting
from vtkmuscle.tradeoff.trial import MuscleTrial, Trial

#: Parts of the package that decide what comes out, and what is within them but does not: a setting has the
#: values of its preset.
_COMPUTING = ("core", "filters", "tradeoff/trial.py", "tradeoff/measures.py", "pipelines.py", "run/report.py")
_NOT_COMPUTING = ("filters/deformer/quality.py",)


class Records:
    """A folder with one JSON file per finished setting.

    A file's name is a digest of the scene, the frames that are compared, the setting and the version (with
    the code that computes), so that a change of any of them runs it anew and the old file stays for what it
    was. A file is moved into place complete.

    Parameters
    ----------
    folder : Path
        Made where it does not exist.
    scene : SceneData
        What is run.
    muscles : sequence of str
        Which of its muscles.
    compared : sequence of int
        Numbers of the frames that are compared.
    """

    def __init__(
        self, folder: Path, scene: SceneData, muscles: Sequence[str], compared: Sequence[int]
    ) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        what = [scene_digest(scene), list(muscles), list(compared), vtkmuscle.__version__, code_digest()]
        self._what = json.dumps(what)

    def key(self, setting: Setting, beside: str | Mapping[str, int] | None = None) -> str:
        """Return the digest of a setting, and of its muscle, or the iterations of a reference."""
        text = json.dumps([self._what, setting.plain(), beside], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def figures(self, setting: Setting, against: Mapping[str, int] | None) -> dict[str, Any] | None:
        """Return what was measured of a setting, None where it has not been run."""
        path = self._folder / f"{self.key(setting, against)}.json"
        if not path.is_file():
            return None
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))["figures"]
        return found

    def keep_figures(
        self, setting: Setting, against: Mapping[str, int] | None, figures: dict[str, Any]
    ) -> None:
        """Keep what was measured of a setting."""
        record = {
            "name": setting.name,
            "group": setting.group,
            "setting": setting.plain(),
            "figures": figures,
        }
        path = self._folder / f"{self.key(setting, against)}.json"
        write_text(path, json.dumps(record, indent=1, allow_nan=False) + "\n")

    def trial(self, setting: Setting, of: str) -> Trial | None:
        """Return a whole trial of a muscle that was kept, None where there is none."""
        path = self._folder / f"{self.key(setting, of)}.npz"
        if not path.is_file():
            return None
        with np.load(path) as arrays:
            facts = json.loads(str(arrays["facts"]))
            muscles = {
                name: MuscleTrial(arrays[f"points_{i}"], arrays[f"lengths_{i}"], **rest)
                for i, (name, rest) in enumerate(facts["muscles"].items())
            }
        return Trial(muscles, facts["memory_mb"])

    def keep_trial(self, setting: Setting, of: str, trial: Trial) -> None:
        """Keep a whole trial of a muscle, points and all: that of a reference."""
        arrays, muscles = {}, {}
        for i, (name, muscle) in enumerate(trial.muscles.items()):
            rest = dict(vars(muscle))
            arrays[f"points_{i}"], arrays[f"lengths_{i}"] = rest.pop("points"), rest.pop("lengths")
            muscles[name] = rest
        facts = json.dumps({"muscles": muscles, "memory_mb": trial.memory_mb})
        with (
            replacing(self._folder / f"{self.key(setting, of)}.npz") as beside,
            beside.open("wb") as file,
        ):
            np.savez_compressed(file, allow_pickle=False, facts=np.array(facts), **arrays)


def scene_digest(scene: SceneData) -> str:
    """Return a digest of all that a scene's result depends on."""
    digest = hashlib.sha256()
    surfaces = {**scene.bones, **{f"muscle {name}": m.surface for name, m in scene.muscles.items()}}
    for name, surface in surfaces.items():
        digest.update(name.encode())
        digest.update(points_of(surface).tobytes())
        digest.update(triangles_of(surface, name).tobytes())
    for name, muscle in scene.muscles.items():
        for area in muscle.attachments:
            digest.update(f"{name} {area.role} {area.bone} {area.closed}".encode())
            digest.update(np.asarray(area.landmarks, dtype=np.float64).tobytes())
        own = [muscle.fibres and dict(muscle.fibres), scene.solver_of(name), scene.fixing_of(name)]
        digest.update(json.dumps(own, sort_keys=True).encode())
    digest.update(scene.motion.times.tobytes())
    for bone, poses in scene.motion.transforms.items():
        digest.update(bone.encode())
        digest.update(np.asarray(poses).tobytes())
    return digest.hexdigest()


def code_digest() -> str:
    """Return a digest of the source that computes and measures."""
    root = Path(vtkmuscle.__file__).parent
    digest = hashlib.sha256()
    for part in _COMPUTING:
        path = root / part
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            name = file.relative_to(root).as_posix()
            if name not in _NOT_COMPUTING:
                digest.update(name.encode())
                digest.update(file.read_bytes())
    return digest.hexdigest()
