"""XML of other programs: elements with line numbers, without entities."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import MOST_TEXT, InputError, check_is_file, fault_of
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import quoted
from vtkmuscle.io.csv_table import number_in

#: Deepest nesting of elements: OpenSim's models have about a dozen, and Python's recursion ends at a
#: thousand.
DEEPEST = 100


@dataclass(slots=True)
class Element:
    """An element of a file: tag, line, attributes, children and text."""

    tag: str
    path: Path
    line: int
    attributes: dict[str, str] = field(default_factory=dict)
    children: list["Element"] = field(default_factory=list)
    text: str = ""

    @property
    def name(self) -> str:
        """The attribute ``name``."""
        return self.attributes.get("name", "")

    def __str__(self) -> str:
        return f"line {self.line}: {self.tag}" + (f" {quoted(self.name)}" if self.name else "")

    def error(self, problem: str, remedy: str = "") -> InputError:
        """Return an error with the file, the line and the element."""
        return InputError(self.path, f"{self}: {problem}", remedy)

    def placed(self, error: ValueError) -> ValueError:
        """Return an error located here, unless already located."""
        if isinstance(error, InputError) and error.where:
            return error
        return self.error(*fault_of(error))

    def only(self, allowed: Sequence[str] | set[str] | frozenset[str]) -> None:
        """Raise an InputError for a child of another tag."""
        for child in self.children:
            if child.tag not in allowed:
                raise child.error(f"is not supported in {self.tag} {quoted(self.name)}")

    def find(self, *tags: str) -> "Element | None":
        """Return the only child with a tag, or None."""
        matches = [child for child in self.children if child.tag in tags]
        if len(matches) > 1:
            raise matches[1].error(f"{self.tag} {quoted(self.name)} has two of them", "remove one")
        return matches[0] if matches else None

    def need(self, *tags: str) -> "Element":
        """Return the child with a tag; raise an InputError if missing."""
        child = self.find(*tags)
        if child is None:
            raise self.error(f"has no {' or '.join(tags)}")
        return child

    def word(self, *tags: str) -> str:
        """Return the text of a child, or ""."""
        child = self.find(*tags)
        return "" if child is None else child.text.strip()

    def numbers(self, count: int | None = None) -> Floats:
        """Return the finite numbers in the text; other text, or another count, raises an InputError."""
        values = np.array([number_in(cell) for cell in self.text.replace(",", " ").split()])
        if not np.isfinite(values).all() or (count is not None and len(values) != count):
            what = "finite numbers" if count is None else f"{count} finite number{'s' * (count > 1)}"
            raise self.error(f"holds {quoted(self.text.strip())}, but must hold {what}")
        return values

    def number(self, tag: str, default: float) -> float:
        """Return the number in a child, or the default."""
        child = self.find(tag)
        return default if child is None else float(child.numbers(1)[0])

    def vector(self, tag: str) -> Floats:
        """Return the 3 numbers in a child, or zeros."""
        child = self.find(tag)
        return np.zeros(3) if child is None else child.numbers(3)

    def flag(self, tag: str, *, default: bool = False) -> bool:
        """Return the boolean in a child, or the default."""
        word = self.word(tag).lower()
        if word not in ("true", "false", ""):
            raise self.need(tag).error(f"holds {quoted(word)}, but must hold true or false")
        return word == "true" if word else default

    def within(self, tag: str) -> list["Element"]:
        """Return the elements in a child; for a set, its objects."""
        child = self.find(tag) or Element(tag, self.path, self.line)
        return child.objects() if tag.endswith("Set") else child.children

    def objects(self) -> list["Element"]:
        """Return the elements in a set's ``objects``."""
        self.only(("objects", "groups"))
        return self.within("objects")


def of_kind(tag: str, elements: Sequence[Element]) -> Sequence[Element]:
    """Return elements with a tag; a different tag raises an InputError."""
    for element in elements:
        if element.tag != tag:
            raise element.error(f"is not supported: only {tag} may be here")
    return elements


def last_part(path: str) -> str:
    """Return the last name of an OpenSim component path."""
    return path.strip().rpartition("/")[2]


def decoded(path: Path) -> str:
    """Return the text of a file of limited size in UTF-8 or Latin-1."""
    check_is_file(path, most=MOST_TEXT)
    data = path.read_bytes()
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def read_xml(path: Path) -> Element:
    """Return the outermost element of an XML file."""
    text = decoded(path)
    parser = expat.ParserCreate("utf-8")
    parser.buffer_text = True
    outermost = Element("", path, 0)
    stack = [outermost]
    words: list[list[str]] = [[]]  # by open element

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = Element(tag, path, parser.CurrentLineNumber, attributes)
        if len(stack) > DEEPEST:
            raise element.error(f"is deeper than {DEEPEST} elements")
        stack[-1].children.append(element)
        stack.append(element)
        words.append([])

    def end(_: str) -> None:
        stack.pop().text = "".join(words.pop())

    def refused(*_: object) -> None:
        problem = f"line {parser.CurrentLineNumber}: the file has a document type (<!DOCTYPE>)"
        raise InputError(path, problem, "remove it: entities are not read")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = lambda part: words[-1].append(part)  # noqa: PLW0108 -- words grow
    parser.StartDoctypeDeclHandler = refused
    try:
        parser.Parse(text.encode("utf-8"), True)
    except expat.ExpatError as error:
        why = expat.errors.messages.get(error.code, "") if isinstance(error.code, int) else str(error)
        problem = f"line {error.lineno}: the file is not XML: {why}"
        raise InputError(path, problem, "export it again") from error
    return outermost.children[0]


def made(tag: str, *parts: ElementTree.Element | str | ArrayLike, **attributes: str) -> ElementTree.Element:
    """Return an element with elements, text or numbers inside."""
    element = ElementTree.Element(tag, attributes)
    for part in parts:
        if isinstance(part, ElementTree.Element):
            element.append(part)
        else:
            element.text = part if isinstance(part, str) else numbers_text(part)
    return element


def numbers_text(values: ArrayLike) -> str:
    """Return numbers with all digits, in a line."""
    return " ".join(map(repr, np.ravel(values).astype(np.float64).tolist()))


def xml_text(root: ElementTree.Element, *, indented: bool = True) -> str:
    """Return the text of an XML file."""
    if indented:
        ElementTree.indent(root, "\t")
    return '<?xml version="1.0" encoding="UTF-8" ?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
