"""What the README, the documentation and the continuous integration say must be so."""

import os
import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

import vtkmuscle

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
DEMO_COMMAND = "python -m pip install . && vtkmuscle demo"
TEST_COMMAND = "python -m pip install '.[test]' && python -m pytest"
DOCS_COMMAND = "python -m sphinx -W -b html docs docs/_build/html"


def blocks(text, language):
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("script", blocks(README, "python"), ids=lambda script: script.split()[1])
def test_the_python_of_the_readme_runs(script, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exec(compile(script, "readme.py", "exec"), {})
    assert capsys.readouterr().out.strip(), "the README promises output"


def test_the_readme_names_the_two_commands():
    commands = [line for block in blocks(README, "console") for line in block.splitlines()]
    assert DEMO_COMMAND in commands
    assert TEST_COMMAND in commands


def test_continuous_integration_runs_the_commands_that_are_written_down():
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    lines = [line.strip() for line in script.splitlines()]
    for command in (TEST_COMMAND, DOCS_COMMAND, "ruff check", "ruff format --check", "mypy"):
        assert command in lines
    assert os.access(ROOT / ".ci" / "run", os.X_OK)
    assert DOCS_COMMAND in (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


def test_the_scene_of_the_readme_is_a_scene(tmp_path):
    """Only its files are missing: every key is known."""
    from vtkmuscle import Scene, SceneError

    (text,) = blocks(README, "toml")
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    with pytest.raises(SceneError, match=r"femur\.stl"):
        Scene.load(tmp_path / "scene.toml")


def test_the_picture_is_there_and_light():
    for path in re.findall(r"!\[[^]]*\]\(([^)]+)\)", README):
        assert 10_000 < (ROOT / path).stat().st_size < 300_000


@pytest.mark.parametrize("path", ["README.md", "CONTRIBUTING.md"])
def test_relative_links_lead_somewhere(path):
    text = (ROOT / path).read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#:]+)\)", text):
        assert (ROOT / target).exists(), target


def test_every_public_name_is_in_the_api_reference():
    text = (ROOT / "docs" / "reference" / "api" / "index.rst").read_text(encoding="utf-8")
    listed = set(re.findall(r"^   (\w+)$", text, flags=re.MULTILINE))
    names = {*vtkmuscle.__all__, *vtkmuscle.filters.__all__} - {"__version__", "filters"}
    names -= {kind.__name__ for kind in vtkmuscle.filters.filter_classes()}  # docs/_ext lists them
    assert names <= listed
    modules = [import_module(name) for name in ("vtkmuscle", "vtkmuscle.filters", "vtkmuscle.run")]
    for name in listed:
        assert any(hasattr(module, name) for module in modules) or find_spec(f"vtkmuscle.{name}"), name


def test_versions_agree():
    for name in ("pyproject.toml", "CITATION.cff"):
        text = (ROOT / name).read_text(encoding="utf-8")
        (version,) = re.findall(r'^version(?: = |: )"?([\d.]+)"?$', text, flags=re.MULTILINE)
        assert version == vtkmuscle.__version__


def named_code():
    """Return the names of code in the table of sentences."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    section = text.partition("## From a sentence to its code")[2].partition("\n## ")[0]
    return re.findall(r"^\| [^|]+ \| `([\w.]+)` \|$", section, flags=re.MULTILINE)


@pytest.mark.parametrize("name", named_code())
def test_a_sentence_leads_to_code_that_is_there(name):
    module, _, member = name.rpartition(".")
    assert callable(getattr(import_module(f"vtkmuscle.{module}"), member))


def test_the_table_of_sentences_is_found():
    assert len(named_code()) > 30
