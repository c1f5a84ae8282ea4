"""Docstrings and pages name things: few pronouns and headless relatives, short first lines."""

import ast
import re
from pathlib import Path

import pytest

import vtkmuscle

ROOT = Path(__file__).resolve().parents[1]
#: Words that stand for other words. By this count trimesh and newton have 24 and 23 in 1000 in docstrings.
PRO_FORM = re.compile(
    "it|its|itself|they|them|their|theirs|that|this|these|those|which|what|whatever|whichever|who|whom|whose|"
    "wherein|whereof|thereof|therein|one|ones|others?|another|same|none|neither|either|likewise|alike|else|"
    "nothing|something|anything|everything|everyone|somebody|nobody"
)
#: Pro-forms in 1000 words, and the mean number of words of a docstring's first line.
MOST, LONGEST = 45.0, 10.0
GENERATED = {"_build", "_templates", "gallery", "generated", "pictures"}
#: Directives with content that is not prose.
BLOCK = re.compile(
    r"\.\. (code|math|csv-table|list-table|table|image|figure|literalinclude|toctree|raw|\||_)"
    r"|\.\. invisible-code-block"
)
MARKUP = re.compile(r"[=\-~^*#\"'`+\s]{3,}")
LITERALS = re.compile(r"``[^`]*``|`[^`]*`|:[\w:]+:`[^`]*`|https?://\S+")


def words_of(text):
    """Return the words of the sentences of a text: no code, tables, options, literals or headings."""
    kept, indent = [], None
    for line in re.sub(r"```.*?```", " ", text, flags=re.DOTALL).splitlines():
        bare, own = line.strip(), len(line) - len(line.lstrip())
        if indent is not None and (not bare or own > indent):
            continue
        indent = own if BLOCK.match(bare) else None
        markup = bare.startswith((">>>", "...", "|", "+-", ":", "..", "!", "<")) or not bare
        if indent is not None or markup or MARKUP.fullmatch(bare):
            continue
        indent = own if bare.endswith("::") else None
        kept.append(line)
    text = LITERALS.sub(" ", "\n".join(kept))
    return [word.lower() for word in re.findall(r"[A-Za-z][A-Za-z']*", text) if word != "None"]


def rate(texts):
    """Return the pro-forms in 1000 words of some texts."""
    words = [word for text in texts for word in words_of(text)]
    assert len(words) > 1000
    return 1000.0 * sum(PRO_FORM.fullmatch(word) is not None for word in words) / len(words)


@pytest.fixture(scope="module")
def docstrings():
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    trees = [ast.parse(path.read_text("utf-8")) for path in Path(vtkmuscle.__file__).parent.rglob("*.py")]
    nodes = [node for tree in trees for node in ast.walk(tree) if isinstance(node, kinds)]
    return [text for node in nodes if (text := ast.get_docstring(node))]


def test_docstrings_name_things(docstrings):
    assert rate(docstrings) <= MOST


def test_pages_name_things():
    pages = [path for path in (ROOT / "docs").rglob("*.rst") if not GENERATED & set(path.parts)]
    assert rate(path.read_text("utf-8") for path in [ROOT / "README.md", *pages]) <= MOST


def test_first_lines_are_short(docstrings):
    lines = [re.sub(r"`[^`]*`", "x", text.partition("\n\n")[0]).partition(". ")[0] for text in docstrings]
    assert sum(len(line.split()) for line in lines) / len(lines) <= LONGEST
