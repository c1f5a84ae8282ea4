"""Print the lowest versions that are declared, as pins for pip: ``python .ci/lower_bounds.py EXTRA...``.

Those in pyproject.toml, of the package and of the extras that are named and that these name.
"""

import re
import sys
import tomllib
from pathlib import Path

REQUIREMENT = re.compile(r"([\w.-]+)(?:\[([\w,-]+)\])?(?:>=([\w.]+))?")


def lowest(project: dict, extra: str) -> list[str]:
    """Return a pin for each requirement of an extra."""
    pins = []
    for text in project["optional-dependencies"][extra]:
        name, inner, version = REQUIREMENT.fullmatch(text).groups()
        if name == project["name"]:
            pins += [pin for one in inner.split(",") for pin in lowest(project, one)]
        else:
            pins.append(f"{name}=={version}")
    return pins


if __name__ == "__main__":
    path = Path(__file__).resolve().parents[1] / "pyproject.toml"
    declared = tomllib.loads(path.read_text(encoding="utf-8"))["project"]
    declared["optional-dependencies"][""] = declared["dependencies"]
    print("\n".join(pin for extra in ["", *sys.argv[1:]] for pin in lowest(declared, extra)))
