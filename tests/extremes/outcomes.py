"""What became of the cases, and the table of it."""

from dataclasses import dataclass, field

HEAD = """\
.. A command, named on this page, writes the page; change the tests, not the page.

Extremes
========

This page shows how the filters handle input beyond any real muscle. Each case ends with finite numbers and
a correct report of the geometry, or with an error and a remedy. The stable modes of PBDDeformer also keep
the volume within 1e-6, each edge within 12 times its length, at most 12 edges folded, and, from 10
iterations on, 95 % of the angles within 30 degrees. "Worst" is the largest value over all cases of a row:
an error if two results must be equal, otherwise the change of shape since rest; edges shorter than a
hundredth of the mean are left out. By default a row has the stable modes with and without bones and
anisotropy, and the published mode with and without bones.

{count} cases, {form} form, seed {seed}. ``pytest -m extremes{option}
--extremes-table=docs/validation/extremes.rst`` writes the page; {rest}.
"""

#: The words on the form of the tests.
LONG = {"form": "long", "option": " --long", "rest": "without ``--long`` the tests have fewer examples"}
SHORT = {
    "form": "short",
    "option": "",
    "rest": "``--long`` adds examples, and meshes of up to a million triangles",
}


@dataclass
class Row:
    """Cases of one kind."""

    count: int = 0
    figure: str = ""
    worst: float = 0.0
    messages: dict[str, int] = field(default_factory=dict)


class Ledger:
    """Counts cases by group and kind."""

    def __init__(self, *, long, seed):
        self.long, self.seed = long, seed
        self.rows = {}

    @property
    def count(self):
        """Number of cases."""
        return sum(row.count for row in self.rows.values())

    def passed(self, group, what, figure, value):
        """Count a case that ended as it should, with a figure of it."""
        row = self.rows.setdefault((group, what), Row())
        row.count += 1
        row.figure = figure
        row.worst = max(row.worst, float(value))

    def refused(self, group, what, message):
        """Count a case that was refused with a message."""
        row = self.rows.setdefault((group, what), Row())
        row.count += 1
        row.messages[message] = row.messages.get(message, 0) + 1

    def write(self, path):
        """Write the table as reStructuredText."""
        lines = [HEAD.format(count=self.count, seed=self.seed, **(LONG if self.long else SHORT))]
        for group in dict.fromkeys(group for group, _ in self.rows):
            lines += [group, "-" * len(group), "", ".. list-table::", "   :header-rows: 1"]
            lines += ["   :widths: 34 8 34 24", "", *_cells("Tried", "Cases", "Worst", "Outcome")]
            for (of, what), row in self.rows.items():
                if of == group:
                    lines += _cells(what, str(row.count), _worst(row), _outcome(row))
            lines.append("")
        path.write_text("\n".join(lines).rstrip("\n") + "\n", encoding="utf-8")


def _cells(*texts):
    return [f"   {'*' if i == 0 else ' '} - {text}".rstrip() for i, text in enumerate(texts)]


def _worst(row):
    return f"{row.figure}: {row.worst:.2g}" if row.figure else ""


def _outcome(row):
    refused = sum(row.messages.values())
    if not refused:
        return "pass"
    told = "; or ".join(f"“{message}”" for message in row.messages)
    return f"error: {told}" if refused == row.count else f"pass; {refused} with error: {told}"
