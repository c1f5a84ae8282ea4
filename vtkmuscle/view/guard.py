"""Who may look at the viewer: whoever has its token, from its own page."""

from __future__ import annotations

import secrets
import tempfile
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

#: Where the server listens, and names of it that a page may have been asked for by.
HOST = "127.0.0.1"
_NAMES = (HOST, "localhost")


@contextmanager
def guarded(server: Any, *, browser: bool) -> Iterator[None]:
    """Let a server that is started within answer none but pages of its own with a token, and open one.

    Parameters
    ----------
    server : trame server
        Not started yet.
    browser : bool
        Whether to open the page in a browser; else its address is printed.
    """
    token = secrets.token_urlsafe(32)
    server.cli.set_defaults(authKey=token)
    server.controller.on_server_bind.add(lambda web: web.app.middlewares.append(_check_of(web)))
    with tempfile.TemporaryDirectory() as folder:  # only this user's

        def open_page(**_: Any) -> None:
            address = f"http://{HOST}:{server.port}/?secret={token}"
            if not browser:
                print(f"The viewer is at {address}", flush=True)  # noqa: T201
                return
            # By a file, for any user can read what a browser was started with.
            page = Path(folder) / "view.html"
            page.write_text(f'<meta http-equiv="refresh" content="0;url={address}">', encoding="utf-8")
            webbrowser.open(page.as_uri())

        server.controller.on_server_ready.add(open_page)
        yield


def _check_of(web: Any) -> Any:
    """Return what refuses requests of pages of other servers, also of those that took this one's address."""
    from aiohttp.web import HTTPForbidden, middleware  # noqa: PLC0415 -- of the extra `view`

    @middleware
    async def check(request: Any, handler: Any) -> Any:
        allowed = {f"{name}:{web.get_port()}" for name in _NAMES}
        origin = request.headers.get("Origin", f"http://{request.host}")
        if request.host not in allowed or origin not in {f"http://{one}" for one in allowed}:
            raise HTTPForbidden(text="the viewer answers its own page only")
        return await handler(request)

    return check
