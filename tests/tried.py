"""What was tried, counted, for a page of the documentation."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

HEAD = """.. This page is written by a command that it names; change the tests, not the page.

What was tried
==============

Damaged input to readers and to every command, signals and full disks, and what became of them. "Used" is a
result that is whole, "refused" one clear error of one line that says what to change; anything else (a
signal, a traceback, a wait of more than 60 s, a file where none was asked for, a damaged file under a final
name) fails the tests.

{total} cases, {form} form, planted seeds. The page is written by ``pytest --long tests/test_fuzz.py
tests/test_damaged_commands.py tests/test_faults.py tests/test_long_runs.py tests/io --tried-table
docs/validation/reliability.rst``; with some of these files their rows alone. The normal run of
tests has a short form.

The heap of a run grows by the frames that its result holds, and is given back with it. Solving the muscles
of subjects after one another adds nothing to it.

.. list-table::
   :header-rows: 1
   :widths: 46 12 12 12

   * - Tried
     - Cases
     - Used
     - Refused
"""

TAIL = """
Planted faults
--------------

Faults that ``python benchmarks/planted_faults.py --write`` plants in ``vtkmuscle.core``, one at a time, and
the first test that sees each: signs, counts that are off by one, clamps that are gone, constants twice as
large, exchanged axes. A hash of the source's lines chooses them. An equivalent one changes nothing that is
promised.

.. include:: reliability_tables/planted_count.txt

.. csv-table::
   :file: reliability_tables/planted.csv
   :header-rows: 1
   :widths: 9 24 26 26 30
"""


@dataclass
class Tried:
    """Counts of cases by what was tried."""

    long: bool
    rows: dict[str, Counter[str]] = field(default_factory=dict)

    def add(self, what: str, outcome: str) -> None:
        """Count a case that was ``"used"`` or ``"refused"``."""
        assert outcome in ("used", "refused")
        self.rows.setdefault(what, Counter())[outcome] += 1

    def write(self, path: Path) -> None:
        """Write the page; rows of what was not tried now stay as they are there."""
        if path.is_file():
            row = r"   \* - (.+)\n     - \d+\n     - (\d+)\n     - (\d+)"
            found = re.findall(row, path.read_text(encoding="utf-8"))
            for what, used, refused in found:
                self.rows.setdefault(what, Counter({"used": int(used), "refused": int(refused)}))
        total = sum(sum(row.values()) for row in self.rows.values())
        lines = [HEAD.format(total=total, form="long" if self.long else "short").rstrip()]
        for what, row in sorted(self.rows.items()):
            lines += [f"   * - {what}", f"     - {sum(row.values())}"]
            lines += [f"     - {row['used']}", f"     - {row['refused']}"]
        path.write_text("\n".join(lines) + "\n" + TAIL, encoding="utf-8")
