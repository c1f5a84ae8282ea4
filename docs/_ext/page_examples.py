"""The code of a page, run in order as a reader would: by the tests, and by the build for the page's pictures.

Python runs in one namespace per page; ``$`` commands of ``vtkmuscle`` and ``python`` run in the folder that
the page is run in, and what is shown below them must come out; a block with ``:caption: NAME`` is the file
NAME, and is written; TOML without one is checked as a part of a scene. Other blocks that cannot be run here
are marked, with the reason: ``.. skip: next "it needs the network"``.
"""

from __future__ import annotations

import doctest
import re
import runpy
import shlex
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from unittest import SkipTest

from pydantic import ValidationError
from sybil import Document, Example, Region, Sybil
from sybil.parsers.rest import CodeBlockParser, DocTestParser, PythonCodeBlockParser, SkipParser
from typer.testing import CliRunner

from vtkmuscle.cli import app
from vtkmuscle.scene.schema import MuscleTable, SceneTable

OUTPUT = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def file_name(region: Region) -> str | None:
    """Return the name of the file that a block is; None where it is none."""
    options: dict[str, str] = region.lexemes.get("options") or {}
    return options.get("caption")


def write_file(example: Example) -> None:
    """Write a block that is a file."""
    Path(str(file_name(example.region))).write_text(str(example.parsed), encoding="utf-8")


class PythonBlocks(PythonCodeBlockParser):
    """Python: a file, or statements."""

    def __call__(self, document: Document) -> Iterator[Region]:
        """Yield the blocks of a page."""
        for region in super().__call__(document):
            if file_name(region):
                region.evaluator = write_file
            yield region


def run_commands(example: Example) -> None:
    """Run the commands of a console block, and compare what is shown below each."""
    for part in re.split(r"^\$ ", str(example.parsed), flags=re.MULTILINE)[1:]:
        command, _, shown = part.replace("\\\n", " ").partition("\n")
        written = output_of(command)
        if shown.strip() and not doctest.OutputChecker().check_output(shown, written, OUTPUT):
            raise AssertionError(f"{command} gives\n{written}\nand not\n{shown}")


def output_of(command: str) -> str:
    """Return what a command prints."""
    program, *words = shlex.split(command, comments=True)
    if program == "vtkmuscle":
        result = CliRunner().invoke(app, words)
        if result.exit_code != 0:
            raise AssertionError(
                f"{command}: status {result.exit_code}\n{result.output}"
            ) from result.exception
        return result.output
    if program == "python" and words[0].endswith(".py"):
        runpy.run_path(words[0], run_name="__main__")
        return ""
    raise AssertionError(f"{command}: nothing here runs {program}; mark the block with '.. skip: next'")


def check_toml(example: Example) -> None:
    """Write a file, or check that a part of a scene has known keys of the right kinds."""
    if file_name(example.region):
        write_file(example)
        return
    tables = tomllib.loads(str(example.parsed))
    model = SceneTable if set(tables) <= set(SceneTable.model_fields) else MuscleTable
    try:
        model.model_validate(tables)
    except ValidationError as error:
        wrong = [one for one in error.errors() if one["type"] != "missing"]
        if wrong:
            raise AssertionError(f"not a part of a scene: {wrong}") from error


EXAMPLES = Sybil(
    parsers=[
        SkipParser(),
        DocTestParser(optionflags=OUTPUT),
        PythonBlocks(),
        CodeBlockParser("console", run_commands),
        CodeBlockParser("toml", check_toml),
    ]
)


def run_page(page: Path) -> int:
    """Run the code of a page in the working folder; return how many blocks ran."""
    document = EXAMPLES.parse(page)
    ran = 0
    for example in document.examples():
        try:
            example.evaluate()
        except SkipTest:
            continue
        ran += 1
    return ran


if __name__ == "__main__":
    run_page(Path(sys.argv[1]).resolve())
