"""Damaged files: a small mutator with planted seeds, and readers in a process that may end."""

import json
import random
import re
import subprocess
import sys
from pathlib import Path

from tried import Tried

#: What all seeds begin at: another one is another set of damaged files.
FIRST_SEED = 20261123
#: Numbers that no counter expects.
HOSTILE = [b"-1", b"0", b"255", b"65536", b"2147483647", b"9223372036854775807", b"1e308", b"nan", b"x", b""]


def mutated(content: bytes, seed: int) -> bytes:
    """Return a file with one to three things wrong with it; the same for the same seed."""
    rng = random.Random(FIRST_SEED + seed)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        content = rng.choice((_number, _number, _flip, _cut, _doubled, _dropped, _words))(content, rng)
    return content


def _number(content: bytes, rng: random.Random) -> bytes:
    # Mostly in the first part, where headers and counts are.
    part = content[:2000] if rng.random() < 0.7 else content
    found = list(re.finditer(rb"-?\d+(\.\d+)?(e-?\d+)?", part))
    if not found:
        return content
    at = rng.choice(found)
    return content[: at.start()] + rng.choice(HOSTILE) + content[at.end() :]


def _flip(content: bytes, rng: random.Random) -> bytes:
    changed = bytearray(content)
    for _ in range(rng.choice((1, 4, 16))):
        if changed:
            changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed)


def _cut(content: bytes, rng: random.Random) -> bytes:
    return content[: rng.randrange(len(content) + 1)]


def _doubled(content: bytes, rng: random.Random) -> bytes:
    start = rng.randrange(len(content) + 1)
    end = min(len(content), start + rng.choice((1, 10, 200)))
    return content[:end] + content[start:]


def _dropped(content: bytes, rng: random.Random) -> bytes:
    start = rng.randrange(len(content) + 1)
    return content[:start] + content[start + rng.choice((1, 10, 200)) :]


def _words(content: bytes, rng: random.Random) -> bytes:
    lines = content.split(b"\n")
    if len(lines) > 2:
        one, other = rng.randrange(len(lines)), rng.randrange(len(lines))
        lines[one], lines[other] = lines[other], lines[one]
    return b"\n".join(lines)


_READ_ALL = """
import json, sys, time, traceback
from pathlib import Path
sys.path.insert(0, {here!r})
from {module} import {name}
for path in json.loads(sys.stdin.read()):
    began = time.perf_counter()
    try:
        {name}(Path(path))
        what, words = "read", ""
    except (ValueError, OSError) as error:
        what, words = "refused", str(error)
    except BaseException as error:
        what, words = "traceback", "".join(traceback.format_exception(error))
    print(json.dumps([path, what, words, time.perf_counter() - began]), flush=True)
"""


def read_all(paths: list[Path], module: str, name: str) -> dict[str, tuple[str, str, float]]:
    """Return what becomes of files that a function reads, in other processes.

    Returns
    -------
    dict
        Per path ``"read"``, ``"refused"``, ``"traceback"`` or ``"signal N"``, what was said, and seconds.
    """
    results: dict[str, tuple[str, str, float]] = {}
    waiting = [str(path) for path in paths]
    script = _READ_ALL.format(here=str(Path(__file__).parent), module=module, name=name)
    while waiting:
        command = [sys.executable, "-c", script]
        done = subprocess.run(command, input=json.dumps(waiting), capture_output=True, text=True, check=False)
        for line in done.stdout.splitlines():
            path, *what = json.loads(line)
            results[path] = tuple(what)
        waiting = [path for path in waiting if path not in results]
        if waiting:  # the one that ended the process
            results[waiting.pop(0)] = (f"signal {-done.returncode}", done.stderr, 0.0)
    return results


def judged(kinds: dict[Path, str], name: str, what: str, tried: Tried) -> None:
    """Check that of damaged files, and what each is, all become a result or one clear error; count them."""
    bad = []
    for path, (outcome, words, _) in read_all(list(kinds), "fuzz_target", name).items():
        if outcome in ("read", "refused"):
            tried.add(what.format(kinds[Path(path)]), "used" if outcome == "read" else "refused")
        else:
            bad.append((path, outcome, words))
    assert not bad, "\n".join(map(str, bad))
