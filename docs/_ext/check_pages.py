"""What is wrong with built pages, found offline: dead links and anchors, requests, malformed DOIs."""

from __future__ import annotations

import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlsplit

if TYPE_CHECKING:
    from sphinx.application import Sphinx

#: What a DOI looks like (Crossref's advice, https://doi.org/10.13003/5jchdy), in lower or upper case.
DOI = re.compile(r"https://doi\.org/10\.\d{4,9}/[-._;()/:<>a-zA-Z0-9]+")
#: Attributes by which a page asks for a file as soon as it is opened.
REQUESTS = {("script", "src"), ("img", "src"), ("iframe", "src"), ("video", "src"), ("source", "src")}
ASKED_FOR = {"stylesheet", "preload", "icon", "modulepreload"}


class Page(HTMLParser):
    """The links, anchors and requests of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.requests: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what a tag links to, is called and asks for."""
        given = {name: value for name, value in attrs if value is not None}
        self.anchors |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        self.requests += [given[name] for kind, name in REQUESTS if kind == tag and name in given]
        if tag == "link" and ASKED_FOR & set(given.get("rel", "").split()):
            self.requests.append(given["href"])


def faults(folder: Path) -> Iterator[str]:
    """Yield what is wrong with the pages in a folder, a line each."""
    built = [path for path in sorted(folder.rglob("*.html")) if "_static" not in path.parts]
    pages = {path: Page(path.read_text(encoding="utf-8")) for path in built}
    for path, page in pages.items():
        where = path.relative_to(folder)
        for target in [*page.links, *page.requests]:
            address = urlsplit(target)
            if address.scheme in ("http", "https"):
                if target in page.requests:
                    yield f"{where}: asks the network for {target}"
                elif address.netloc == "doi.org" and not DOI.fullmatch(unquote(target)):
                    yield f"{where}: {target} is no DOI"
            elif not address.scheme:
                yield from _local_fault(where, path, address.path, address.fragment, pages)


def _local_fault(where: Path, path: Path, target: str, anchor: str, pages: dict[Path, Page]) -> Iterator[str]:
    file = (path.parent / unquote(target)).resolve() if target else path
    if not file.exists():
        yield f"{where}: there is no {target}"
    elif anchor and file in pages and unquote(anchor) not in pages[file].anchors:
        yield f"{where}: there is no #{anchor} in {target or 'it'}"


def check(app: Sphinx, exception: Exception | None) -> None:
    """Fail the build where a page has a fault."""
    from sphinx.errors import ExtensionError  # noqa: PLC0415 -- the tests look for faults without Sphinx

    if exception is None and app.builder.format == "html":
        found = sorted(set(faults(Path(app.outdir).resolve())))
        if found:
            raise ExtensionError("\n".join(["the built pages are at fault:", *found]))


def setup(app: Sphinx) -> dict[str, Any]:
    """Check the pages when they are built."""
    app.connect("build-finished", check)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
