"""What was tried, counted, for a page of the documentation."""

import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

HEAD = """.. A command, named on this page, writes the page; change the tests, not the page.

Reliability
===========

This page shows the outcome of damaged input, signals and full disks, for readers and every command. "Used"
is a complete result, "refused" a one-line error with a remedy. A test fails after a signal, a traceback, a
wait of more than 60 s, an unwanted file, or a damaged file under a final name.

{total} cases, {form} form, planted seeds. ``pytest --long tests/test_fuzz.py tests/test_damaged_commands.py
tests/test_faults.py tests/test_long_runs.py tests/io --tried-table docs/validation/reliability.rst`` writes
the page; a part of the files updates a part of the rows. The normal tests have a short form.

The heap of a run grows by the frames of the result, and shrinks when the result is freed. A series of
subjects adds no memory.

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

``python benchmarks/planted_faults.py --write`` plants faults in ``vtkmuscle.core``, a fault per test run:
wrong signs, counts off by one, missing clamps, doubled constants, exchanged axes. A hash of the source's
lines chooses the faults. The table has the first failing test for each fault. An equivalent fault changes
no promised result. The table is of commit 8b36ec2; some functions have been renamed or merged since.

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
