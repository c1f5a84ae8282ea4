"""Structures by name: kind, side, and joints."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from pathlib import Path

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.words import suggestion
from vtkmuscle.io.csv_table import csv_rows

#: Words in bone names; a name with a muscle word is a muscle's.
BONES = re.compile(
    r"(?:^|_)(?:femur|tibia|fibula|patella|pelvis|hip|coxae?|innominate|ili(?:um|a)|ischium|pubis|sacrum|coccyx|"
    r"vertebrae?|ribs?|sternum|scapula|clavi(?:cle|cula)|humerus|ulna|radius|(?:meta)?(?:carp|tars)als?|"
    r"phalan(?:x|ges)|talus|calcaneus|navicular|cuboid|cuneiform|skull|cranium|mandible|bone|shank|forearm|foot|"
    r"hand)(?:_|$)"
)
#: Starts of words in muscle names, then words in names of other structures.
_MUSCLES = re.compile(
    r"(?:^|_)(?:muscle|glut|iliac|psoas|iliopsoas|adduct|abduct|flexor|extensor|vast|rectus|sartor|gracil|bicep|"
    r"tricep|quadricep|semi|soleus|gastroc|tibial|peron|fibulari|plantar|poplit|pectin|piriform|obturator|gemell|"
    r"quadratus|tensor|delt|supraspin|infraspin|subscap|teres|trapez|latiss|rhomb|pector|serrat|brachial|"
    r"brachior|coraco|anconeus|pronator|supinator|palmar|multifid|erector|autochthon|splenius|sternocleid|"
    r"longus|brevis|scalen|levator|oblique|compartment|longissimus|iliocost|hamstring|transversospin)"
)
_NEITHER = re.compile(
    r"(?:^|_)(?:trunk|vein|vena|vessel|artery|nerve|disc|discs|cartilage|cartilages|cord|skin|fat|marrow)(?:_|$)"
)
_SIDES = {"left": "left", "l": "left", "right": "right", "r": "right"}


@dataclass(frozen=True)
class JointKind:
    """A kind of joint between bones with certain names.

    Attributes
    ----------
    name : str
        Name of the joint.
    children, parents : tuple of str
        Words in bone names; the first existing bone counts.
    form : str
        ``"ball"``, ``"pin"`` or ``"weld"``.
    round_end : str
        ``"child"`` or ``"parent"``: the bone with the round surface.
    axes : dict of str to (3,) tuple
        Axes in LPS by coordinate, for a hanging right limb. A left limb reverses all axes but the first.
    most : float
        Largest angle of the first coordinate [degrees].
    """

    name: str
    children: tuple[str, ...]
    parents: tuple[str, ...]
    form: str = "weld"
    round_end: str = "child"
    axes: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    most: float = 0.0


_FORWARD, _INWARD, _ABOUT = (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)
_FOOT = ("talus", "calcaneus", "foot", "tarsal", "tarsals", "metatarsal", "metatarsals", "phalanges")
_PELVIS = ("hip", "pelvis", "coxa", "coxae", "innominate", "ilium")
_HAND = ("hand", "carpal", "carpals", "metacarpal", "metacarpals")


def _three(joint: str) -> dict[str, tuple[float, float, float]]:
    return {f"{joint}_flexion": _FORWARD, f"{joint}_adduction": _INWARD, f"{joint}_rotation": _ABOUT}


#: Joints of the limbs; a patella follows the shank, as by its tendon.
JOINTS = (
    JointKind("hip", ("femur",), _PELVIS, "ball", axes=_three("hip"), most=60.0),
    JointKind("knee", ("tibia", "shank"), ("femur",), "pin", "parent", {"knee_flexion": (1.0, 0, 0)}, 60.0),
    JointKind("shoulder", ("humerus",), ("scapula",), "ball", axes=_three("shoulder"), most=60.0),
    JointKind("elbow", ("ulna", "forearm"), ("humerus",), "pin", "parent", {"elbow_flexion": _FORWARD}, 60.0),
    JointKind("fibula", ("fibula",), ("tibia",)),
    JointKind("patella", ("patella",), ("tibia", "shank")),
    JointKind("foot", _FOOT, ("tibia", "shank")),
    JointKind("radius", ("radius",), ("ulna",)),
    JointKind("hand", _HAND, ("ulna", "radius", "forearm")),
)


def plain_name(name: str) -> str:
    """Return a lower-case name with underscores, the side at the end.

    Examples
    --------
    >>> from vtkmuscle.labels.names import plain_name
    >>> plain_name("Left Gluteus Maximus"), plain_name("femur R")
    ('gluteus_maximus_left', 'femur_right')
    """
    words = re.findall(r"[a-z0-9]+", name.casefold())
    side = next((_SIDES[word] for word in words if word in _SIDES), None)
    rest = [word for word in words if word not in _SIDES]
    return "_".join([*rest, *([side] if side else [])]) or "unnamed"


def side_of(name: str) -> str | None:
    """Return ``"left"``, ``"right"``, or None for a name without side."""
    return next((side for side in ("left", "right") if plain_name(name).endswith(f"_{side}")), None)


def stem_of(name: str) -> str:
    """Return a plain name without side."""
    return re.sub(r"_(left|right)$", "", plain_name(name))


def kind_of(name: str) -> str | None:
    """Return ``"bone"``, ``"muscle"``, or None for other names.

    Examples
    --------
    >>> from vtkmuscle.labels.names import kind_of
    >>> [kind_of(name) for name in ("Femur_R", "rectus femoris", "tibialis_anterior_left", "liver")]
    ['bone', 'muscle', 'muscle', None]
    """
    plain = plain_name(name)
    if _NEITHER.search(plain):
        return None
    if _MUSCLES.search(plain):
        return "muscle"
    return "bone" if BONES.search(plain) else None


@cache
def _tables() -> dict[str, dict[int, str]]:
    tables: dict[str, dict[int, str]] = {}
    for line in files("vtkmuscle.labels").joinpath("names.csv").read_text(encoding="utf-8").splitlines()[3:]:
        table, label, name = line.split(",")
        tables.setdefault(table, {})[int(label)] = name
    return tables


def name_table(source: str) -> dict[int, str]:
    """Return names by label from a built-in or .csv table.

    Lines of a file are label, name.

    Raises
    ------
    FileNotFoundError, ValueError
        If there is no such table or file, or a line is not a label and a name.
    """
    if source in _tables():
        return _tables()[source]
    path = Path(source)
    if path.suffix.lower() != ".csv":
        raise InputError(source, "unknown table of names", suggestion(source, [*_tables(), "FILE.csv"]))
    names = {}
    for number, cells in csv_rows(path):
        if len(cells) > 1 and cells[0].strip().isdigit():
            names[int(cells[0])] = cells[1].strip()
        elif names:
            raise InputError(path, f"line {number} is not a label and a name", "write 5, femur_left")
    if not names:
        raise InputError(path, "the file has no line of a label and a name", "write 5, femur_left")
    return names
