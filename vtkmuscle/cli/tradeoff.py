"""``vtkmuscle tradeoff``: a scene run with many settings, each against a converged run."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import typer

from vtkmuscle.cli.messages import one_clear_error, say
from vtkmuscle.cli.options import FolderOption, FreshOption, QuietOption


def tradeoff(
    scene: Annotated[
        str,
        typer.Argument(metavar="SCENE", help="A scene.toml, or 'demo': the phantom hip."),
    ],
    out: FolderOption,
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only",
            metavar="NAME",
            help="Group or beginning of names of settings; may be repeated.",
        ),
    ] = None,
    muscle: Annotated[
        list[str] | None,
        typer.Option("--muscle", metavar="NAME", help="Muscle; may be repeated."),
    ] = None,
    frames: Annotated[
        str | None,
        typer.Option("--frames", metavar="A:B:STEP", help="Frames to compare. Default: every fifth."),
    ] = None,
    every: Annotated[
        int,
        typer.Option("--every", metavar="N", min=1, help="Use only every Nth frame of the motion."),
    ] = 1,
    fresh: FreshOption = False,
    quiet: QuietOption = False,
) -> None:
    """Measure what speed costs in accuracy: run a scene with many settings, each against a converged run.

    Finished settings are kept in OUT and not run again; stop and start it as you like.
    """
    with one_clear_error(None):
        from vtkmuscle.run import frame_numbers
        from vtkmuscle.scenes import Scene
        from vtkmuscle.studies.tradeoff import trade_off, write_trade_off
        from vtkmuscle.studies.variation import thinned

        if scene == "demo":
            from vtkmuscle import phantoms

            loaded = Scene.from_phantom(phantoms.hip())
        else:
            loaded = Scene.load(scene)
        motion = thinned(loaded.motion, every)
        loaded = replace(loaded, motion=motion)
        compared = None if frames is None else frame_numbers(frames, len(motion.times))
        found = trade_off(
            loaded,
            out,
            only=only or (),
            muscles=muscle or (),
            compared=compared,
            fresh=fresh,
            announce=lambda words: say(quiet, words),
        )
        for path in write_trade_off(out, found):
            say(quiet, f"wrote {path}")
