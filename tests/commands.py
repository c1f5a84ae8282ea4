"""The command line in this process, and Python in a process of its own."""

import subprocess
import sys

from typer.testing import CliRunner

from vtkmuscle.cli import app


def vtkmuscle_(*arguments):
    return CliRunner().invoke(app, [*map(str, arguments)], catch_exceptions=False)


def python(*arguments, **options):
    """Return a process of Python that has ended well."""
    command = [sys.executable, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=900, **options)
    assert done.returncode == 0, done.stdout + done.stderr
    return done
