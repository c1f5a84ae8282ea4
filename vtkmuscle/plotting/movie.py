"""Pictures one after the other as a film: a .gif by Pillow, an .mp4 by FFmpeg."""

from __future__ import annotations

from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.errors import InputError
from vtkmuscle.io.writing import replacing

#: What a film can be.
SUFFIXES = (".gif", ".mp4")


def check_movie(path: str | PathLike[str], fps: float) -> Path:
    """Return the file of a film, having checked that it can be written here.

    Raises
    ------
    ValueError
        For another suffix, or a rate that is not positive.
    ImportError
        For an .mp4 without imageio-ffmpeg.
    """
    file = Path(path)
    if file.suffix.lower() not in SUFFIXES:
        raise InputError(
            str(path), f"a film is one of {', '.join(SUFFIXES)}", "give it one of these suffixes"
        )
    if not fps > 0:
        raise InputError("", f"fps is {fps}, but must be a number > 0")
    if file.suffix.lower() == ".mp4":
        _ffmpeg()
    return file


def write_movie(path: Path, pictures: Iterator[NDArray[np.uint8]], *, fps: float) -> Path:
    """Write a film, all or nothing.

    Parameters
    ----------
    path : Path
        Checked by :func:`check_movie`; replaced where it exists.
    pictures : iterator of (height, width, 3) array
        At least one, all of one size, even in both directions for an .mp4.
    fps : float
        Pictures per second.
    """
    with replacing(path) as beside:
        if path.suffix.lower() == ".gif":
            _write_gif(beside, pictures, fps)
        else:
            _write_mp4(beside, pictures, fps)
    return path


def _write_gif(path: Path, pictures: Iterator[NDArray[np.uint8]], fps: float) -> None:
    from PIL import Image  # noqa: PLC0415 -- matplotlib has it; only films need it

    # One palette for all: colours that change from picture to picture flicker.
    first, *others = (Image.fromarray(picture).quantize(128) for picture in pictures)
    first.save(path, format="GIF", save_all=True, append_images=others, duration=round(1000 / fps), loop=0)


def _write_mp4(path: Path, pictures: Iterator[NDArray[np.uint8]], fps: float) -> None:
    first = next(pictures)
    height, width = first.shape[:2]
    named = path.with_name(path.name + ".mp4")  # FFmpeg goes by the name
    writer = _ffmpeg().write_frames(str(named), (width, height), fps=fps, macro_block_size=2, quality=8)
    try:
        writer.send(None)
        writer.send(np.ascontiguousarray(first))
        for picture in pictures:
            writer.send(np.ascontiguousarray(picture))
        writer.close()
        named.replace(path)
    finally:
        named.unlink(missing_ok=True)


def _ffmpeg() -> Any:
    try:
        import imageio_ffmpeg  # noqa: PLC0415 -- an extra
    except ImportError as error:
        raise ImportError(
            "an .mp4 needs imageio-ffmpeg: python -m pip install '.[movie]'; a .gif needs no more"
        ) from error
    return imageio_ffmpeg
