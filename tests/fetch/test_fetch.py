"""Downloads: what is checked becomes a scene, all else is one error that leaves nothing behind."""

import hashlib
import json
import shutil
import socket
import sys
from pathlib import Path

import pytest
from commands import refused, vtkmuscle_
from file_server import serving

from vtkmuscle import InputError, Scene, fetch
from vtkmuscle import public_data as public

sys.path.insert(0, str(Path(__file__).parents[1]))
from tiny_scene import write_tiny_scene

PATH = f"owner/tiny/{40 * 'a'}"


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    """The files of a small scene by their names in it."""
    folder = tmp_path_factory.mktemp("published")
    write_tiny_scene(folder)
    return {str(path.relative_to(folder)): path for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def tiny(published, monkeypatch):
    """The small scene in place of the data set; the files that a server has."""
    content = {name: path.read_bytes() for name, path in published.items()}

    def write_hip_scene(downloads, folder):
        for name in content:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(downloads / name.replace("/", "_"), folder / name)

    files = {
        name.replace("/", "_"): (f"{PATH}/{name}", hashlib.sha256(data).hexdigest())
        for name, data in content.items()
    }
    for name, value in {
        "FILES": files,
        "LICENCE": "You may.\n",
        "RETRIES": 0,
        "write_hip_scene": write_hip_scene,
    }.items():
        monkeypatch.setattr(public, name, value)
    return {f"{PATH}/{name}": data for name, data in content.items()}


def nothing_left(folder):
    """Return whether a folder is as empty as it was."""
    return list(folder.iterdir()) == []


def test_what_is_published_becomes_a_scene(tiny, tmp_path):
    with serving(tiny) as (host, asked):
        path = fetch("lhdl-hip", tmp_path / "here", accept_licence=True, host=host)
    assert path == tmp_path / "here" / "scene.toml"
    assert Scene.load(path).name == "tiny"
    assert sorted(asked) == sorted(tiny)
    assert (tmp_path / "here" / "LICENCE.txt").read_text() == "You may.\n"
    sources = json.loads((tmp_path / "here" / "sources.json").read_text())
    assert {one["url"]: one["sha256"] for one in sources} == {
        f"{host}/{name}": hashlib.sha256(data).hexdigest() for name, data in tiny.items()
    }
    assert not (tmp_path / "here" / "source").exists()
    assert [one.name for one in tmp_path.iterdir()] == ["here"]


def test_without_the_licence_nothing_is_asked_for(tiny, tmp_path):
    with serving(tiny) as (host, asked), pytest.raises(InputError, match="licence is not accepted"):
        fetch("lhdl-hip", tmp_path / "here", host=host)
    assert asked == []
    assert nothing_left(tmp_path)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("changed", r"motion\.csv: the download failed: SHA256 .*expected"),
        ("cut", r"the download failed: .*Connection broken"),
        ("missing", "404"),
    ],
)
def test_what_is_changed_cut_or_missing_is_refused(tiny, tmp_path, fault, words):
    name = next(name for name in tiny if name.endswith("motion.csv"))
    if fault == "changed":
        tiny[name], faults = tiny[name].replace(b"1", b"2", 1), {}
    else:
        faults = {fault: {name}}
    with serving(tiny, **faults) as (host, _), pytest.raises(InputError, match=words) as caught:
        fetch("lhdl-hip", tmp_path / "here", accept_licence=True, host=host)
    assert caught.value.where == f"{host}/{name}"
    assert nothing_left(tmp_path)


def test_without_a_network_there_is_one_clear_error(tiny, tmp_path):
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        host = f"http://127.0.0.1:{closed.getsockname()[1]}"
        with pytest.raises(InputError, match=r"the download failed: .*Connection refused"):
            fetch("lhdl-hip", tmp_path / "here", accept_licence=True, host=host)
    assert nothing_left(tmp_path)


def test_a_folder_in_the_way_is_left_alone(tiny, tmp_path):
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "mine.txt").write_text("mine")
    with serving(tiny) as (host, asked), pytest.raises(InputError, match="folder exists"):
        fetch("lhdl-hip", tmp_path / "here", accept_licence=True, host=host)
    assert asked == []
    assert [one.name for one in (tmp_path / "here").iterdir()] == ["mine.txt"]


def test_the_command_shows_the_licence_and_wants_it_accepted(tiny, tmp_path):
    with serving(tiny) as (host, _):
        call = "fetch", "lhdl-hip", "--out", tmp_path / "here", "--host", host
        said = vtkmuscle_(*call, status=2).output
        assert "You may." in said
        assert "--accept-licence" in said
        assert nothing_left(tmp_path)
        vtkmuscle_(*call, "--accept-licence")
    assert (tmp_path / "here" / "scene.toml").is_file()


def test_a_name_that_is_not_known_is_answered_with_those_that_are():
    assert "lhdl-hip: " in vtkmuscle_("fetch").output
    assert "did you mean 'lhdl-hip'" in refused("fetch", "lhdl-knee")
