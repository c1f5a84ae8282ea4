"""The package stays small: lines against a budget that is not part of it, and short files and signatures."""

import ast
import io
import os
import tokenize
import tomllib
from collections import Counter
from pathlib import Path

import pytest

import vtkmuscle

ROOT, REPOSITORY = Path(vtkmuscle.__file__).parent, Path(__file__).resolve().parents[1]
#: The limits, by what they are of; another file by the environment variable.
BUDGET = Path(os.environ.get("VTKMUSCLE_BUDGET", REPOSITORY.parent / "shared" / "budget.toml"))

#: Tokens that are no code.
BLANK = (
    *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE),
    *(tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER),
)
WITH_DOCSTRING = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def lines_of_code(text):
    """Return how many lines of a source hold code: no docstrings, comments or blanks."""
    lines = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in BLANK:
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, WITH_DOCSTRING) and ast.get_docstring(node, clean=False) is not None:
            lines.difference_update(range(node.body[0].lineno, node.body[0].end_lineno + 1))
    return len(lines)


def sources(folder):
    return {path: path.read_text(encoding="utf-8") for path in folder.rglob("*.py")}


def lines_in(texts):
    return sum(len(text.splitlines()) for text in texts)


def test_sizes_are_within_the_budget():
    if not BUDGET.is_file():
        pytest.skip(f"there is no budget at {BUDGET}; set VTKMUSCLE_BUDGET to its file")
    budget, package = tomllib.loads(BUDGET.read_text(encoding="utf-8")), sources(ROOT)
    code = {path: lines_of_code(text) for path, text in package.items()}
    sizes = {
        ("code", "total"): sum(code.values()),
        ("code", "core"): sum(count for path, count in code.items() if ROOT / "core" in path.parents),
        ("code", "files"): len(code),
        ("code", "lines"): lines_in(package.values()),
        ("tests", "lines"): lines_in(sources(REPOSITORY / "tests").values()),
        ("docs", "changelog_lines"): lines_in([(REPOSITORY / "CHANGELOG.md").read_text(encoding="utf-8")]),
    }
    over = [
        f"{part}.{name}: {size} of {limit}, over by {size - limit}"
        for (part, name), size in sizes.items()
        if size > (limit := budget[part][name])
    ]
    assert not over


#: Functions with more parameters than seven, and why.
LONG_SIGNATURES = {
    "phantoms.phantom.phantom_from",  # the fields of a phantom
    "pipelines.__init__.__init__",  # the inputs of a pipeline
    "pipelines.__init__.deform",  # the inputs of a deformer
}
KERNELS = ("kernel", "array_kernel", "vector_kernel", "reduction", "lane")


def test_functions_take_at_most_seven_parameters():
    long = set()
    for path, text in sources(ROOT).items():
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for node in ast.walk(ast.parse(text)):
            if not isinstance(node, ast.FunctionDef):
                continue
            parameters = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            compiled = any(ast.unparse(one).startswith(KERNELS) for one in node.decorator_list)
            if not compiled and len([one for one in parameters if one.arg not in ("self", "cls")]) > 7:
                long.add(f"{module}.{node.name}")
    assert long <= LONG_SIGNATURES


def test_files_are_short_and_folders_small():
    files = sources(ROOT)
    assert not [path.name for path, text in files.items() if len(text.splitlines()) > 400]
    folders = Counter(path.parent.name for path in files)
    del folders["filters"]  # each filter has a module
    assert max(folders.values()) <= 20
