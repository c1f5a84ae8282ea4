"""The viewer: its server starts, its page draws, and its slider moves the muscles."""

import asyncio
import os
import re
import subprocess
import sys
import time

import numpy as np
import pytest
from browser import Page, needs_chromium
from PIL import Image
from tiny_scene import write_tiny_scene
from typer.testing import CliRunner

from vtkmuscle import InputError, Scene
from vtkmuscle.cli import BAD_INPUT, app
from vtkmuscle.data.arrays import points_of
from vtkmuscle.plotting import can_render

pytestmark = pytest.mark.skipif(can_render() is not None, reason=str(can_render()))


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory):
    return write_tiny_scene(tmp_path_factory.mktemp("scene"))


def test_a_scene_is_solved_for_the_frames_that_are_shown(scene_file):
    from vtkmuscle.view import SceneDisplay

    scene = Scene.load(scene_file)
    solved = SceneDisplay(scene, off_screen=True, size=(200, 160))
    solved.show(4)
    result = scene.run()
    pose = solved._known[4]
    np.testing.assert_allclose(
        pose.muscles["spindle"], points_of(result.muscle("spindle", frame=4)), atol=1e-9
    )
    np.testing.assert_allclose(
        pose.fibres["spindle"], points_of(result.fibres("spindle", frame=4)), atol=1e-9
    )
    assert set(solved._known) == {0, 4}, "what is not shown is not asked for"
    solved.scene.plotter.close()


def test_what_is_not_there_is_said(tmp_path):
    pytest.importorskip("trame_pyvista", reason="the extra 'view' is not installed")
    from vtkmuscle.view import make_app

    with pytest.raises(InputError, match="no such file or folder"):
        make_app(tmp_path / "nothing")


def test_without_trame_it_is_said_what_to_install(scene_file, monkeypatch):
    from vtkmuscle.view import make_app

    monkeypatch.setitem(sys.modules, "trame.app", None)
    with pytest.raises(InputError, match=r"'\.\[view\]'"):
        make_app(scene_file)


def test_the_command_without_trame_or_opengl_is_one_clear_error(scene_file, monkeypatch):
    def view_():
        done = CliRunner().invoke(app, ["view", str(scene_file)], catch_exceptions=False)
        assert done.exit_code == BAD_INPUT
        assert done.stdout == ""
        assert len(done.stderr.splitlines()) == 1
        return done.stderr

    monkeypatch.setattr("vtkmuscle.view.app.can_render", lambda: "there is no OpenGL")
    assert view_().startswith("error: nothing can be shown: there is no OpenGL; ")
    monkeypatch.setitem(sys.modules, "trame.app", None)
    assert view_().startswith("error: the viewer needs trame (trame.app is missing): ")


@pytest.fixture(scope="module")
def address(scene_file, tmp_path_factory):
    """The address of a viewer of the scene, in a process of its own."""
    pytest.importorskip("trame_pyvista", reason="the extra 'view' is not installed")
    command = [sys.executable, "-m", "vtkmuscle", "view", str(scene_file), "--no-browser"]
    log = tmp_path_factory.mktemp("viewer") / "log.txt"
    with log.open("w") as said:
        process = subprocess.Popen(command, stdout=said, stderr=subprocess.STDOUT, env=os.environ)
    try:
        end = time.monotonic() + 120
        while not (found := re.search(r"http://127\.0\.0\.1:\d+/\S*", log.read_text())):
            assert process.poll() is None, log.read_text()
            assert time.monotonic() < end, log.read_text()
            time.sleep(0.2)
        yield found.group()
    finally:
        process.terminate()
        process.wait()


def test_only_its_own_page_with_the_token_is_answered(address):
    aiohttp = pytest.importorskip("aiohttp")
    base, token = address.split("?secret=")
    assert len(token) > 40

    async def hello(secret, **headers):
        """Return whether the server lets a client in, the status where it refuses the connection."""
        message = {"wslink": "1.0", "id": "system:c0:0", "method": "wslink.hello"}
        message |= {"args": [{"secret": secret}], "kwargs": {}}
        try:
            async with (
                aiohttp.ClientSession(headers=headers) as session,
                session.ws_connect(base + "ws") as socket,
            ):
                await socket.send_bytes(packed(message))
                return b"clientID" in (await socket.receive(timeout=30)).data
        except aiohttp.WSServerHandshakeError as refused:
            return refused.status

    async def status(**headers):
        async with aiohttp.ClientSession(headers=headers) as session, session.get(base) as answer:
            return answer.status

    assert asyncio.run(hello(token)) is True
    assert asyncio.run(hello(token, Origin=base.rstrip("/"))) is True
    for guess in ("wslink-secret", "", token[:-1]):
        assert asyncio.run(hello(guess)) is False
    assert asyncio.run(hello(token, Origin="http://elsewhere.example")) == 403
    assert asyncio.run(status()) == 200
    assert asyncio.run(status(Host="elsewhere.example")) == 403  # a name that was turned to this address
    assert asyncio.run(status(Origin="http://127.0.0.1:1")) == 403


def packed(message):
    """Return a message as wslink sends it: its size and number before it, in one chunk."""
    body = pytest.importorskip("msgpack").packb(message)
    return np.array([1, 0, len(body)], dtype="<u4").tobytes() + body


#: The picture of the scene has come.
DRAWN = "[...document.querySelectorAll('main img')].some((one) => one.naturalWidth > 100)"


@needs_chromium
def test_the_page_draws_and_the_slider_moves_the_muscle(address, tmp_path):
    def picture(page, name):
        page.picture(tmp_path / name)
        return np.asarray(Image.open(tmp_path / name).convert("RGB"), dtype=int)[100:500]

    with Page(900, 600) as page:
        page.open(address, ready=DRAWN)
        page.wait("document.querySelector('main').textContent.includes('time 0')")
        end = time.monotonic() + 30
        while (first := picture(page, "first.png")).min() > 200 and time.monotonic() < end:
            time.sleep(0.3)
        assert first.min() < 200, "the scene is there"
        page.value("document.querySelector('[role=slider]').focus()")
        page.key("End")
        page.wait("document.querySelector('main').textContent.includes('time 20')")
        moved = first
        while np.abs(moved - first).max() < 60 and time.monotonic() < end:
            time.sleep(0.3)
            moved = picture(page, "moved.png")
        assert (np.abs(moved - first).max(axis=2) > 60).mean() > 0.001
        assert page.value("document.querySelector('[role=slider]').getAttribute('aria-label')") == "time"
        own = (address.split("?")[0], "data:", "blob:")
        elsewhere = [one for one in page.requests if not one.startswith(own)]
        assert elsewhere == []
