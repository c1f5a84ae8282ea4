"""``vtkmuscle tradeoff``: a scene run with many settings, each against a converged run."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import typer

from vtkmuscle.cli.messages import one_clear_error, say
from vtkmuscle.cli.options import FolderOption, FreshOption, QuietOption, with_options


@dataclass(frozen=True, kw_only=True)
class TradeOffOptions:
    """The options of a trade-off."""

    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only",
            metavar="NAME",
            help="Group or beginning of names of settings; may be repeated.",
        ),
    ] = None
    muscle: Annotated[
        list[str] | None,
        typer.Option("--muscle", metavar="NAME", help="Muscle; may be repeated."),
    ] = None
    frames: Annotated[
        str | None,
        typer.Option("--frames", metavar="A:B:STEP", help="Frames to compare. Default: every fifth."),
    ] = None
    every: Annotated[
        int,
        typer.Option("--every", metavar="N", min=1, help="Use only every Nth frame of the motion."),
    ] = 1
    fresh: FreshOption = False
    quiet: QuietOption = False


@with_options
def tradeoff(
    scene: Annotated[
        str,
        typer.Argument(metavar="SCENE", help="A scene.toml, or 'demo': the phantom hip."),
    ],
    out: FolderOption,
    *,
    options: TradeOffOptions,
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
        motion = thinned(loaded.motion, options.every)
        loaded = replace(loaded, motion=motion)
        compared = None if options.frames is None else frame_numbers(options.frames, len(motion.times))
        found = trade_off(
            loaded,
            out,
            only=options.only or (),
            muscles=options.muscle or (),
            compared=compared,
            fresh=options.fresh,
            announce=lambda words: say(options.quiet, words),
        )
        for path in write_trade_off(out, found):
            say(options.quiet, f"wrote {path}")
