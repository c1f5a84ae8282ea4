"""``vtkmuscle from-labels`` and ``init``: scenes from label maps, meshes, landmarks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vtkmuscle.cli.messages import say
from vtkmuscle.cli.options import FolderOption, QuietOption, with_options
from vtkmuscle.core.errors import InputError

if TYPE_CHECKING:
    from vtkmuscle.labels.draft import Draft

FrameOption = Annotated[
    str, typer.Option("--frame", metavar="LPS|RAS", help="Frame of the surfaces: x to the left, or right.")
]
OverwriteOption = Annotated[
    bool, typer.Option("--overwrite", help="Write over a scene.toml that is there already.")
]


@dataclass(frozen=True, kw_only=True)
class LabelOptions:
    """The options of a scene from labels."""

    names: Annotated[
        str | None,
        typer.Option(
            help="Names of labels: musclemap, a task of TotalSegmentator, or a .csv of label, name."
        ),
    ] = None
    edge: Annotated[float, typer.Option(min=0.1, help="Length of triangles' edges [mm].")] = 3.0
    frame: FrameOption = "LPS"
    overwrite: OverwriteOption = False
    quiet: QuietOption = False


@with_options
def from_labels(
    label_map: Annotated[
        Path,
        typer.Argument(
            metavar="MAP", help="A .nii.gz, .nrrd, .mha or .dcm file, or a folder of one per structure."
        ),
    ],
    out: FolderOption,
    landmarks: Annotated[
        list[Path] | None,
        typer.Argument(help="Landmarks in the map's frame: files called MUSCLE_origin or MUSCLE_insertion."),
    ] = None,
    *,
    options: LabelOptions,
) -> None:
    """Make a scene from a segmentation: surfaces, attachment areas, fitted joints.

    Missing input is guessed: guesses.csv and comments in scene.toml list each guess with its certainty. A
    tendon is drawn to landmarks beyond a muscle's label. A muscle that fails is reported with the reason; the
    scene has the remaining muscles.
    """
    from vtkmuscle.labels.maps import draft_of_labels

    _check_free(out, options.overwrite)
    draft = draft_of_labels(
        label_map,
        landmarks=landmarks or (),
        names=options.names,
        frame=options.frame,
        edge=options.edge,
        announce=lambda words: say(options.quiet, words),
    )
    _write(draft, out, options.quiet)


def init(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="Meshes of bones and muscles; landmarks called MUSCLE_origin or MUSCLE_insertion."
        ),
    ],
    out: FolderOption = Path(),
    bone: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="A bone, whatever it is called.")
    ] = None,
    muscle: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="A muscle, whatever it is called.")
    ] = None,
    frame: FrameOption = "LPS",
    overwrite: OverwriteOption = False,
    quiet: QuietOption = False,
) -> None:
    """Write a scene.toml from meshes and landmarks, guessing missing input.

    Names identify bones and muscles, sizes the unit, contact or landmarks the areas, fits to bones the
    joints. guesses.csv and comments in scene.toml list each guess with its certainty.
    """
    from vtkmuscle.labels.meshes import draft_of_files

    _check_free(out, overwrite)
    draft = draft_of_files(files, out, bones=bone or (), muscles=muscle or (), frame=frame)
    draft.complete()
    _write(draft, out, quiet)


def _check_free(out: Path, overwrite: bool) -> None:
    if (out / "scene.toml").exists() and not overwrite:
        raise InputError(out / "scene.toml", "it is there already", "say --overwrite, or another --out")


def _write(draft: Draft, out: Path, quiet: bool) -> None:
    from vtkmuscle.labels.guesses import LEFT_OUT, LOOK, table_of
    from vtkmuscle.labels.page import write_page

    path, page = draft.write(out), write_page(draft, out)
    unsure = [guess for guess in draft.guesses if guess.confidence < LOOK and guess.value != LEFT_OUT]
    say(quiet, f"{len(draft.guesses)} guesses are in {page}" + ("; check these:" if unsure else ""))
    for confidence, what, guess, why in table_of(unsure)[1:]:
        say(quiet, f"  {confidence}  {what}: {guess}; {why}")
    for name, why in draft.left_out.items():
        typer.echo(f"left out: {name}: {why}", err=True)
    say(quiet, f"wrote {path}, with {', '.join(draft.muscles)}: check the guesses, then run")
    say(quiet, f"  vtkmuscle run {path}")
