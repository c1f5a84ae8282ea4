"""What became of the cases, and the table of it."""

from dataclasses import dataclass, field

HEAD = """\
.. This page is written by a command that it names; change the tests, not the page.

Extremes
========

Input that no real muscle has, and how the filters handled it. Each case ended with finite numbers
and a report that agrees with the geometry, or with an error that says what to change. The stable modes of the
deformer also keep the volume within 1e-6, each edge within 12 times its length, at most 12 edges folded, and,
from 10 iterations on, 95 % of the angles within 30 degrees. "Worst" is the largest
value of what is named beside it over all cases of a row: an error where two results must be equal, else a
figure that says how far the shape is from rest; edges of less than a hundredth of the mean do not count.
{modes}

{count} cases, {form} form, seed {seed}. The page is written by ``pytest -m extremes{option} --extremes-table
docs/validation/extremes.rst``; {other}.
"""

#: What is said of the form that was run.
LONG = {
    "form": "long",
    "option": " --long",
    "modes": "Where nothing else is said, the stable modes with and without bones and anisotropy were\n"
    "tried, and the published one with and without bones.",
    "other": "the normal run of the tests has a short form of it",
}
SHORT = {
    "form": "short",
    "option": "",
    "modes": "Where nothing else is said, the stable modes with and without bones and anisotropy were\n"
    "tried, and the published one with and without bones.",
    "other": "with ``--long`` it tries more examples, and meshes of up to a million triangles",
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
