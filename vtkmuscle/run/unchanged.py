"""A scene that the program writes as a model, which its user may have edited since."""

from __future__ import annotations

import shutil
from filecmp import cmp
from pathlib import Path

from vtkmuscle.core.errors import InputError
from vtkmuscle.io.writing import beside
from vtkmuscle.scene.data import SceneData
from vtkmuscle.scene.writing import write_scene


def save_unless_changed(scene: SceneData, folder: Path, *, overwrite: bool) -> Path:
    """Write a scene to a folder, and return its scene.toml.

    Raises
    ------
    ValueError
        If a file there has been changed since it was written, unless ``overwrite`` is true.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    fresh = beside(folder)
    try:
        write_scene(scene, fresh)
        files = [path.relative_to(fresh) for path in fresh.rglob("*") if path.is_file()]
        for file in sorted(files):
            there = folder / file
            if there.is_file() and cmp(there, fresh / file, shallow=False):
                continue
            if (there.exists() or there.is_symlink()) and not overwrite:
                raise InputError(
                    there,
                    "this has been changed since it was written",
                    f"run it with 'vtkmuscle run {folder / 'scene.toml'}', give another folder with --out, "
                    "or --overwrite to replace it",
                )
        for file in files:
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            (fresh / file).replace(folder / file)
    except OSError as error:
        named = str(error.filename or error).replace(str(fresh), str(folder))
        if error.errno is None:
            raise OSError(named) from error
        raise OSError(error.errno, error.strerror, named) from error
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
    return folder / "scene.toml"
