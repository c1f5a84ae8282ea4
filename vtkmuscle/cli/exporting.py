"""``vtkmuscle export`` of muscles to OpenSim and MuJoCo."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer

from vtkmuscle.core.errors import InputError
from vtkmuscle.opensim import write_mujoco, write_opensim
from vtkmuscle.opensim.from_run import GEOMETRY_ONLY


def export_muscles(
    source: Path,
    out: Path,
    form: str,
    groups: int,
    into: Path | None,
    replace: Sequence[str],
    specific_tension: float,
    geometry_only: bool,
) -> None:
    """Write a model, and say by how much its paths differ from the run."""
    options: dict[str, Any] = {"groups": groups, "specific_tension": specific_tension}
    if geometry_only:
        options["kind"] = GEOMETRY_ONLY
    if out.suffix.lower() == ".xml":
        written = write_mujoco(source, out, **options)
    else:
        written = write_opensim(source, out, form=form, into=into, replace=pairs(replace), **options)
    for one in written:
        typer.echo(f"{one.out.name}: {one}")
        if one.out.parameters:
            typer.echo(f"  {', '.join(f'{name} {value:.4g}' for name, value in one.out.parameters.items())}")
    typer.echo(f"wrote {out}, and the errors in {out.stem}_errors.csv")


def pairs(texts: Sequence[str]) -> dict[str, str]:
    """Return what is given as OURS=THEIRS."""
    for text in texts:
        if not all(text.partition("=")):
            raise InputError("--replace", f"{text!r} is no pair", "write OURS=THEIRS, both names of muscles")
    return {ours: theirs for ours, _, theirs in (text.partition("=") for text in texts)}
