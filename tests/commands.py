"""The command line in this process, and Python in a process of its own."""

import subprocess
import sys

from typer.testing import CliRunner

from vtkmuscle.cli import Status, app


def vtkmuscle_(*arguments, status=0):
    """Return what the command line says, which must end with a status; None is any."""
    done = CliRunner().invoke(app, [*map(str, arguments)], catch_exceptions=False)
    assert status in (None, done.exit_code), done.output
    return done


def refused(*arguments):
    """Run a command that is refused, expect a line for each fault and nothing else, and return them."""
    done = vtkmuscle_(*arguments, status=Status.BAD_INPUT)
    assert done.stderr
    assert not done.stdout or arguments[0] == "info"  # which names each file first
    assert all(line.startswith("error: ") and len(line) < 600 for line in done.stderr.splitlines())
    return done.stderr


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def python(*arguments, **options):
    """Return a process of Python that has ended well."""
    command = [sys.executable, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=900, **options)
    assert done.returncode == 0, done.stdout + done.stderr
    return done
