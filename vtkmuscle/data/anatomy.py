"""Names of bones and muscles, joints between bones, and published numbers of muscles by name."""

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple
from unicodedata import normalize

from vtkmuscle.data import package_text, toml_table

#: Tables of anatomy.toml: words of names, and joints.
ANATOMY = toml_table("vtkmuscle.data", "anatomy.toml")
_SIDES: dict[str, str] = ANATOMY["sides"]


@dataclass(frozen=True)
class JointKind:
    """A kind of joint between bones with certain words in their names. The first existing bone counts.

    ``children`` and ``parents`` are words as of :func:`has_word`;
    ``form`` is ``"ball"``, ``"pin"`` or ``"weld"``; ``round_end``, ``"child"`` or ``"parent"``, has the round
    surface; ``axes`` (3,) are in LPS by coordinate, for a hanging right limb: a left limb reverses all axes
    but the first; ``most`` is the largest angle of the first coordinate [degrees].
    """

    name: str
    children: Sequence[str]
    parents: Sequence[str]
    form: str = "weld"
    round_end: str = "child"
    axes: Mapping[str, Sequence[float]] = field(default_factory=dict)
    most: float = 0.0


#: Joints of the limbs.
JOINTS = tuple(JointKind(**table) for table in ANATOMY["joints"])


def plain_name(name: str) -> str:
    """Return a lower-case name with underscores and without accents, the side at the end."""
    name = normalize("NFKD", name).encode("ascii", "ignore").decode()
    words = re.findall(r"[a-z0-9]+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).casefold())
    side = next((_SIDES[word] for word in words if word in _SIDES), None)
    rest = [word for word in words if word not in _SIDES]
    return "_".join([*rest, *([side] if side else [])]) or "unnamed"


def side_of(name: str) -> str | None:
    """Return ``"left"``, ``"right"``, or None for a name without side."""
    return next((side for side in ("left", "right") if f"_{plain_name(name)}".endswith(f"_{side}")), None)


def stem_of(name: str) -> str:
    """Return a plain name without side."""
    return re.sub(r"_(left|right)$", "", plain_name(name))


def has_word(name: str, words: Sequence[str]) -> bool:
    """Return whether one of words, regular expressions, is in a name."""
    return re.search(rf"(?:^|_)(?:{'|'.join(words)})(?:_|$)", stem_of(name)) is not None


#: Factor between a person's ratios and published means: two standard deviations of fibre lengths are 0.25 to
#: 0.55 of the mean (Ward et al. 2009, doi:10.1007/s11999-008-0594-8); a belly without tendon has two thirds.
PERSONAL = 1.5


class Published(NamedTuple):
    """A published range of a quantity of a muscle, by a coordinate or none."""

    muscle: str
    quantity: str
    coordinate: str
    values: tuple[float, float]  # of the coordinate [degrees]
    unit: str
    low: float
    high: float
    source: str


@cache
def _table() -> tuple[tuple[tuple[frozenset[str], ...], Published], ...]:
    lines = package_text("vtkmuscle.data", "published.csv").splitlines()
    rows = []
    for row in csv.DictReader(line for line in lines if not line.startswith("#")):
        span = float(row["from_deg"] or 0.0), float(row["to_deg"] or 0.0)
        ends = float(row["low"]), float(row["high"])
        keys = row["muscle"], row["quantity"], row["coordinate"]
        names = tuple(map(_words, (row["muscle"], *row["names"].split())))
        rows.append((names, Published(*keys, span, row["unit"], *ends, row["source"])))
    return tuple(rows)


def _words(name: str) -> frozenset[str]:
    words = (ANATOMY["equal"].get(word, word) for word in re.findall("[a-z0-9]+", stem_of(name)))
    return frozenset(words).difference(ANATOMY["idle"])


def published(muscle: str, quantity: str = "", coordinate: str = "") -> Published | None:
    """Return the published range of a muscle's quantity, None if unknown.

    ``muscle`` is a name in any of the usual forms: ``"semimem_r"``, ``"Semimembranosus left"``; the range of
    a whole muscle includes its heads and parts. ``quantity`` is ``"moment_arm"``, ``"fibre_length"``,
    ``"pennation"``, ``"pcsa"``, ``"greatest_force"``, ``"fibre_to_path"`` or ``"path_length"``, by default
    any; ``coordinate`` is as in the table: ``"knee_flexion"``.

    Examples
    --------
    >>> from vtkmuscle.data.anatomy import published
    >>> found = published("semimem_r", "moment_arm", "knee_flexion")
    >>> found.low, found.high, found.source
    (17.7, 46.3, 'Rajagopal 2016')
    """
    words = _words(muscle)
    rows = [row for names, row in _table() if words in names]
    if not rows:  # the parts of a muscle, by its first word and perhaps further ones
        parts = ((names[0], row) for names, row in _table() if row.muscle.split("_")[0] in words)
        rows = [row for name, row in parts if words <= name]
    rows = [row for row in rows if quantity in ("", row.quantity) and coordinate in ("", row.coordinate)]
    if not rows:
        return None
    source = ", ".join(dict.fromkeys(row.source for row in rows))
    low, high = min(row.low for row in rows), max(row.high for row in rows)
    return rows[0]._replace(low=low, high=high, source=source)


def published_arm(muscle: str, coordinate: str, positive: str = "") -> Published | None:
    """Return a muscle's published moment arms by a coordinate of any name and direction.

    None if unknown, and by a coordinate of the other side.
    """
    if {side_of(muscle), side_of(coordinate)} == {"left", "right"}:
        return None
    theirs, sign = published_coordinate(coordinate, positive)
    arm = published(muscle, "moment_arm", theirs) if theirs else None
    if arm is None or sign > 0.0:
        return arm
    low, high = arm.values
    return arm._replace(low=-arm.high, high=-arm.low, values=(-high, -low))


def published_coordinate(name: str, positive: str = "") -> tuple[str, float]:
    """Return the table's coordinate of a coordinate's name and direction, and the sign, 1 or -1."""
    own, said = (set(re.findall("[a-z]+", text.casefold().replace("_", " "))) for text in (name, positive))
    for coordinate in dict.fromkeys(row.coordinate for _, row in _table() if row.coordinate):
        joint, direction = coordinate.split("_", 1)
        if joint not in own:
            continue
        for words in (said, own):
            if any(word in words for word, other in ANATOMY["opposite"].items() if other == direction):
                return coordinate, -1.0
            if direction in words:
                return coordinate, 1.0
    return "", 0.0
