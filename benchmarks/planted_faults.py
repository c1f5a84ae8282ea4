"""Plant 60 faults in the core, one at a time, and say which of them no test sees.

``python benchmarks/planted_faults.py`` runs, for each, the tests next to it: those of its module, of its
room (``tests/core/ROOM``), then those that name it and those of the modules that import it. A fault is seen
when one of them fails or takes more than four minutes; ``--write`` writes the table of the documentation,
``--list`` only says what would be planted. It takes about an hour: kernels that change are compiled again.
With ``--again`` those are planted only that the table does not have as seen.

Which faults: of each of five kinds, the twelve places whose hash (of ``SEED``, the kind, the module, the
function and the line's text) is lowest, one of a function. Nobody chooses them, and a change elsewhere leaves
them alone. Nothing is planted in texts, annotations and what is raised.

- sign: ``a + b`` for ``a - b`` and the other way round, ``a`` for ``-a``
- off by one: a ``range`` or slice one shorter, ``<=`` for ``<`` beside a whole number
- clamp: the first argument that is no constant, for ``min``, ``max``, ``clip`` and the like of it
- constant: twice a constant (neither these nor clamps of those below 1e-6, which guard against rounding)
- axis: another component, ``p[i, 1]`` for ``p[i, 0]``, or another ``axis=``
"""

from __future__ import annotations

import argparse
import ast
import csv
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from vtkmuscle.core.jit import kernel_folder

ROOT = Path(__file__).resolve().parents[1]
CORE = ROOT / "vtkmuscle" / "core"
TABLE = ROOT / "docs" / "validation" / "reliability_tables" / "planted.csv"
SEED = 20210615
#: Of each kind.
FAULTS = 12
#: A test that takes longer hangs [s], and tests of one fault together are stopped [s].
LONGEST, LONGEST_OF_ALL = 240, 900
#: Smaller constants are guards against rounding.
SMALLEST = 1e-6

#: Columns of the table, and what its last one has of a fault that no test sees.
HEAD, UNSEEN = ("kind", "where", "was", "planted", "seen by"), "no test"

#: Faults that change no result that is promised, by what is planted, and why.
EQUIVALENT: dict[str, str] = {
    "core.motion.blending._by_newton: m * b + n * q -> (m * b - n * q)": (
        "equivalent: the steps come to no end, and the quaternion gives the same rotation, later"
    ),
    "core.fibres.mean_value._see_far: n_close > 0 -> (n_close >= 0)": (
        "equivalent: lanes are looked through, and none is found"
    ),
    "core.bones.bone.: 1e-3 -> 0.002": "equivalent: any small unevenness decides between axes",
    "core.bones.lookup.least_distance_at: v - b -> (v + b)": "equivalent: a lower bound, looked up oftener",
    "core.fibres.mean_value._see_far: 0.5 -> 1.0": "equivalent: far triangles are seen as near ones",
    "core.fibres.spreading.steps_to_centres: 2.0 -> 4.0": "equivalent: twice as many nodes, in more time",
    "core.mesh.sampling.: 1.324717957244746 -> 2.649435914489492": "equivalent: other numbers, as even",
    "core.paths.bone_contact.BoneContacts.sags: 0.5 -> 1.0": "equivalent: a bound, looked up more often",
    "core.template.fit_box: 360.0 -> 720.0": "equivalent: each box is tried twice",
    "core.pbd.solver.: 1.0 -> 2.0": "equivalent: the way is tried in quarters, and as far as it goes",
    "core.paths.surroundings.: 1e-6 -> 2e-06": "equivalent: a guard against rounding",
    "core.fibres.between_areas.matched_ends: -1 -> (1)": (
        "equivalent: sets may be halved along any direction; sums of squares differ by less than 0.02 %"
    ),
}


@dataclass(frozen=True)
class Fault:
    """A place in the core and what is planted there."""

    kind: str
    module: str
    function: str
    line: int
    start: int
    end: int
    before: str
    after: str
    text: str

    @property
    def rank(self) -> str:
        """Faults of the lowest ranks of a kind are planted."""
        words = f"{SEED} {self.kind} {self.module} {self.function} {self.text} {self.before} {self.after}"
        return hashlib.sha256(words.encode()).hexdigest()

    @property
    def name(self) -> str:
        """What is planted, for a table."""
        return f"{self.module}.{self.function}: {self.before} -> {self.after}"

    @property
    def row(self) -> tuple[str, ...]:
        """The fault in the table, under all of :data:`HEAD` but the last."""
        words = f"{self.module}.{self.function}".strip("."), self.before, self.after
        return self.kind, *(f"``{word}``" for word in words)

    def planted(self, source: str) -> str:
        """Return a source with the fault in it."""
        return source[: self.start] + self.after + source[self.end :]


def _signs(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    if isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.Add | ast.Sub):
        sides = (node.left, node.right) if isinstance(node, ast.BinOp) else (node.value,)
        if not any(_is_text_or_list(side) for side in sides):
            yield "sign", _with(node, op=ast.Sub() if isinstance(node.op, ast.Add) else ast.Add())
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield "sign", node.operand


def _off_by_one(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    one = ast.Constant(1)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "range":
        at = 0 if len(node.args) == 1 else 1
        args = [ast.BinOp(arg, ast.Sub(), one) if k == at else arg for k, arg in enumerate(node.args)]
        yield "off by one", _with(node, args=args)
    if isinstance(node, ast.Slice) and node.upper is not None and node.step is None:
        yield "off by one", _with(node, upper=ast.BinOp(node.upper, ast.Sub(), one))
    elif isinstance(node, ast.Slice) and node.lower is not None and node.step is None:
        yield "off by one", _with(node, lower=ast.BinOp(node.lower, ast.Add(), one))
    other = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}
    if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in other:
        sides = [side.value for side in (node.left, *node.comparators) if isinstance(side, ast.Constant)]
        if any(type(side) is int for side in sides):
            yield "off by one", _with(node, ops=[other[type(node.ops[0])]()])


def _clamps(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    if not isinstance(node, ast.Call):
        return
    name = getattr(node.func, "attr", getattr(node.func, "id", ""))
    if name in ("min", "max", "minimum", "maximum", "clip") and len(node.args) > 1 and not node.keywords:
        numbers = [arg.value for arg in node.args if isinstance(arg, ast.Constant)]
        values = [arg for arg in node.args if not isinstance(arg, ast.Constant | ast.UnaryOp)]
        guard = any(isinstance(number, float) and 0.0 < abs(number) < SMALLEST for number in numbers)
        if values and not guard and not isinstance(node.args[0], ast.Starred):
            yield "clamp", values[0]


def _constants(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    if isinstance(node, ast.Constant) and isinstance(node.value, float) and abs(node.value) >= SMALLEST:
        yield "constant", ast.Constant(2.0 * node.value)


def _axes(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    other = {0: 1, 1: 0, 2: 1}
    if isinstance(node, ast.Subscript):
        last = node.slice.elts[-1] if isinstance(node.slice, ast.Tuple) else node.slice
        if isinstance(last, ast.Constant) and type(last.value) is int and last.value in other:
            new = ast.Constant(other[last.value])
            if isinstance(node.slice, ast.Tuple):
                new = ast.Tuple([*node.slice.elts[:-1], new])
            yield "axis", _with(node, slice=new)
    if isinstance(node, ast.keyword) and node.arg == "axis" and isinstance(node.value, ast.Constant):
        yield "axis", _with(node, value=ast.Constant(other.get(node.value.value, 0)))


KINDS = (_signs, _off_by_one, _clamps, _constants, _axes)


def _is_text_or_list(node: ast.AST) -> bool:
    joined = ast.JoinedStr, ast.List, ast.Tuple, ast.ListComp
    return isinstance(node, joined) or (
        isinstance(node, ast.Constant) and isinstance(node.value, str | bytes)
    )


def _with(node: ast.AST, **changes: object) -> ast.AST:
    """Return a copy of a node with other fields."""
    return type(node)(**{**dict(ast.iter_fields(node)), **changes})


def _nodes(node: ast.AST, function: str) -> Iterator[tuple[ast.AST, str]]:
    """Give the nodes of a module with the function that each is in; none of texts, annotations and errors."""
    for name, child in ast.iter_fields(node):
        for one in child if isinstance(child, list) else [child]:
            skipped = name in ("annotation", "returns", "decorator_list") or isinstance(
                one, ast.Raise | ast.JoinedStr
            )
            if not isinstance(one, ast.AST) or skipped:
                continue
            within = function
            if isinstance(one, ast.FunctionDef | ast.ClassDef):
                within = f"{function}.{one.name}".lstrip(".")
            yield one, within
            yield from _nodes(one, within)


def faults_of(path: Path) -> Iterator[Fault]:
    """Give every fault that could be planted in a file."""
    source = path.read_text(encoding="utf-8")
    lines = source.splitlines(keepends=True)
    begins = [sum(map(len, lines[:number])) for number in range(len(lines))]

    def place(line: int, column: int) -> int:
        return begins[line - 1] + len(lines[line - 1].encode()[:column].decode())

    module = ".".join(path.relative_to(CORE.parent).with_suffix("").parts)
    for node, function in _nodes(ast.parse(source), ""):
        for find in KINDS:
            for kind, new in find(node):
                start, end = place(node.lineno, node.col_offset), place(node.end_lineno, node.end_col_offset)
                after = ast.unparse(ast.fix_missing_locations(new))
                if isinstance(node, ast.expr) and not isinstance(node, ast.Slice | ast.Constant):
                    after = f"({after})"
                text = lines[node.lineno - 1].strip()
                words = " ".join(source[start:end].split())
                yield Fault(kind, module, function, node.lineno, start, end, words, after, text)


def chosen() -> list[Fault]:
    """Return the faults that are planted."""
    ranked = sorted(
        (fault for path in CORE.rglob("*.py") for fault in faults_of(path)), key=lambda fault: fault.rank
    )
    counts: Counter[str] = Counter()
    taken: dict[tuple[str, str, str], Fault] = {}
    for fault in ranked:
        place = fault.kind, fault.module, fault.function
        if counts[fault.kind] < FAULTS and place not in taken:
            counts[fault.kind] += 1
            taken[place] = fault
    return sorted(taken.values(), key=lambda fault: (fault.kind, fault.module, fault.line))


@cache
def _sources(folder: Path) -> dict[Path, str]:
    return {path: path.read_text(encoding="utf-8") for path in sorted(folder.rglob("*.py"))}


def _importing(module: str, folder: Path) -> list[Path]:
    """Return the files of a folder that import a module of the package."""
    rooms, _, name = module.rpartition(".")
    names = re.compile(rf"vtkmuscle\.{module}\b|vtkmuscle\.{rooms} import [^\n]*\b{name}\b")
    return [path for path, text in _sources(folder).items() if names.search(text)]


def tests_of(module: str) -> list[str]:
    """Return the test files next to a module of the core, those nearest to it first."""
    tests = [path for path in _sources(ROOT / "tests") if path.name.startswith("test_")]
    files, modules = [], [module]
    for _ in range(3):  # the module, the modules that import it, and those that import them
        beside = {
            ROOT.joinpath("tests", *each.split(".")).with_name(f"test_{each.split('.')[-1]}.py")
            for each in modules
        }
        files += [path for path in tests if path in beside]
        if modules == [module]:
            files += [
                path for path in tests if path.parent == ROOT.joinpath("tests", *module.split(".")[:-1])
            ]
            files += [path for path in _importing(module, ROOT / "tests") if path in tests]
        importing = [path for each in modules for path in _importing(each, CORE.parent)]
        modules = [
            ".".join(path.relative_to(CORE.parent).with_suffix("").parts) for path in dict.fromkeys(importing)
        ]
    return [str(path.relative_to(ROOT)) for path in dict.fromkeys(files)]


class Copy:
    """A copy of the repository in which faults are planted, one at a time.

    Parameters
    ----------
    folder : Path
        Where it goes.
    kernels : Path
        Compiled kernels of what is sound.
    """

    def __init__(self, folder: Path, kernels: Path) -> None:
        self._folder, self._kernels = folder, kernels
        shutil.copytree(
            ROOT, folder, ignore=shutil.ignore_patterns(".git", "__pycache__", ".*_cache", "_build")
        )

    def seen_by(self, fault: Fault) -> str:
        """Plant a fault and return the first test that sees it, "" where none does."""
        path = (self._folder / "vtkmuscle").joinpath(*fault.module.split(".")).with_suffix(".py")
        sound, files = path.read_text(encoding="utf-8"), tests_of(fault.module)
        path.write_text(fault.planted(sound), encoding="utf-8")
        try:
            test = self._failing(files)
        finally:
            path.write_text(sound, encoding="utf-8")
        if test and self._failing(files if test.startswith("ended") else [test]):
            sys.exit(f"{test} fails without a fault as well")
        return test

    def _failing(self, tests: list[str]) -> str:
        """Run tests and return the first that fails, "" where none does."""
        with tempfile.TemporaryDirectory() as folder:
            own = Path(folder) / "kernels"
            shutil.copytree(self._kernels, own, copy_function=os.link)
            environment = {
                **os.environ,
                "PYTHONPATH": str(self._folder),
                "NUMBA_CACHE_DIR": str(own),
                "VTKMUSCLE_DATA": str(self._folder / "no data"),
                "PYTHONDONTWRITEBYTECODE": "1",
            }
            limits = ["-o", f"faulthandler_timeout={LONGEST}", "-o", "faulthandler_exit_on_timeout=true"]
            command = [sys.executable, "-m", "pytest", "-x", "-n0", "-q", "-p", "no:cacheprovider", *limits]
            try:
                done = subprocess.run(
                    [*command, *tests],
                    cwd=self._folder,
                    env=environment,
                    capture_output=True,
                    text=True,
                    check=False,
                    timeout=LONGEST_OF_ALL,
                )
            except subprocess.TimeoutExpired:
                return ""
        failed = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - |$)", done.stdout, re.MULTILINE)
        test = failed.group(1) if failed else f"ended with {done.returncode}"
        return test if done.returncode else ""


def planted(faults: list[Fault], jobs: int) -> Iterator[str]:
    """Give for each fault the first test that sees it, "" where none does."""
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(jobs) as pool:
        kernels = Path(folder) / "kernels"
        compiled = kernel_folder()
        if compiled is not None and compiled.is_dir():
            shutil.copytree(compiled, kernels)
        kernels.mkdir(0o755, exist_ok=True)
        free = [Copy(Path(folder) / f"{number}", kernels) for number in range(jobs)]

        def seen_by(fault: Fault) -> str:
            copy = free.pop()
            try:
                return copy.seen_by(fault)
            finally:
                free.append(copy)

        yield from pool.map(seen_by, faults)


def known() -> dict[Fault, str]:
    """Return what the table has of the faults that are planted today, and were seen or are equivalent."""
    with TABLE.open(newline="", encoding="utf-8") as file:
        rows = {tuple(row[:-1]): row[-1] for row in list(csv.reader(file))[1:]}
    here = {fault: EQUIVALENT.get(fault.name, rows[fault.row]) for fault in chosen() if fault.row in rows}
    return {fault: outcome for fault, outcome in here.items() if outcome != UNSEEN}


def main() -> None:
    """Do what the options say."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--list", action="store_true", help="say what would be planted")
    parser.add_argument("--only", metavar="TEXT", help="faults whose name has this in it")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="faults at a time (default: 1)")
    parser.add_argument("--again", action="store_true", help="those that the table does not have as seen")
    parser.add_argument("--write", action="store_true", help="write the table of the documentation")
    asked = parser.parse_args()
    faults = [fault for fault in chosen() if asked.only is None or asked.only in fault.name]
    if asked.list:
        print(*(f"{fault.kind:12}{fault.name}" for fault in faults), sep="\n")
        return
    seen = known() if asked.again else {}
    waiting = [fault for fault in faults if fault not in seen]
    for fault, test in zip(waiting, planted(waiting, asked.jobs), strict=True):
        seen[fault] = test or EQUIVALENT.get(fault.name, UNSEEN)
        print(f"{fault.kind:12}{fault.name}\n{'':12}{seen[fault]}", flush=True)
    count = Counter(seen[fault].partition(":")[0] for fault in faults)
    unseen, same = count[UNSEEN], count["equivalent"]
    summary = f"Of {len(faults)} faults tests see {len(faults) - unseen - same}, "
    summary += f"{same} are equivalent, and {unseen} unseen."
    print(summary)
    if asked.write:
        TABLE.parent.mkdir(exist_ok=True)
        with TABLE.open("w", newline="", encoding="utf-8") as file:
            rows = [[*fault.row, seen[fault]] for fault in faults]
            csv.writer(file, lineterminator="\n").writerows([HEAD, *rows])
        TABLE.with_name("planted_count.txt").write_text(summary + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
