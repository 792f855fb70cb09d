# SPDX-License-Identifier: Apache-2.0
"""The web server: the page and its parts, and a socket for each browser. On this machine alone."""

import asyncio
import contextlib
import errno
import socket
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from importlib import resources
from pathlib import Path

from aiohttp import WSCloseCode, WSMsgType, web

from css_console.audience import Spectator
from css_console.errors import ConsoleError
from css_console.guards import ADDRESS, HEADERS, Guard
from css_console.orders import LONGEST
from css_console.stage import Stage

LOOKS_PER_S = 10.0
_SEND_BUFFER = 1 << 18  # bytes that the system keeps for a browser that does not read
_MOST_BROWSERS = 16
_TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}


class Server:
    """Serves one stage."""

    def __init__(self, stage: Stage, libraries: Mapping[str, Path], token: str) -> None:
        """Prepares.

        Args:
            stage: what is shown.
            libraries: files of JavaScript libraries by their served name.
            token: part of the address.
        """
        self._stage, self._libraries, self._token = stage, libraries, token
        self._guard: Guard | None = None
        own = resources.files("css_console") / "data"
        self._files = {file.name: file.read_bytes() for file in own.iterdir() if Path(file.name).suffix in _TYPES}

    @asynccontextmanager
    async def serving(self, port: int) -> AsyncIterator[str]:
        """Serves inside the context; gives the address with the token.

        Raises:
            ConsoleError: the port is taken.
        """
        listener = _listener(port)
        port = listener.getsockname()[1]
        self._guard = Guard(port, self._token)
        application = web.Application(middlewares=[self._guarded], client_max_size=LONGEST)
        application.router.add_get("/{token}/", self._page)
        application.router.add_get("/{token}/socket", self._socket)
        application.router.add_get("/{token}/{file}", self._file)
        runner = web.AppRunner(application, access_log=None, shutdown_timeout=1.0)
        await runner.setup()
        try:
            await web.SockSite(runner, listener).start()
            yield f"http://{ADDRESS}:{port}/{self._token}/"
        finally:
            await runner.cleanup()

    async def look_until(self, over: asyncio.Event) -> None:
        """Looks at the graph again and again, and shows what is new.

        One timer and no task for a look: each round of the event loop takes the interpreter from the flight's thread.
        """
        loop = asyncio.get_running_loop()
        failures: list[Exception] = []

        def look() -> None:
            if over.is_set():
                return
            try:
                self._stage.look()
            except Exception as error:
                failures.append(error)
                over.set()
            loop.call_later(1.0 / LOOKS_PER_S, look)

        look()
        await over.wait()
        if failures:
            raise failures[0]

    @web.middleware
    async def _guarded(
        self, request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
    ) -> web.StreamResponse:
        assert self._guard is not None
        refusal = self._guard.refusal(request.headers, request.match_info.get("token", ""))
        if refusal:
            return web.Response(status=403, text=f"{refusal}\n", headers=HEADERS)
        return await handler(request)

    async def _page(self, request: web.Request) -> web.Response:
        return self._answer("index.html", self._files["index.html"])

    async def _file(self, request: web.Request) -> web.Response:
        name = request.match_info["file"]
        if name in self._libraries:
            return self._answer(name, self._libraries[name].read_bytes())
        if name in self._files:
            return self._answer(name, self._files[name])
        return web.Response(status=404, text="there is no such file\n", headers=HEADERS)

    @staticmethod
    def _answer(name: str, body: bytes) -> web.Response:
        return web.Response(body=body, content_type=_TYPES[Path(name).suffix], charset="utf-8", headers=HEADERS)

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        if len(self._stage.audience) >= _MOST_BROWSERS:
            return web.Response(status=503, text=f"{_MOST_BROWSERS} browsers watch already\n", headers=HEADERS)
        browser = web.WebSocketResponse(max_msg_size=LONGEST, heartbeat=30.0, compress=False)
        if not browser.can_prepare(request):
            return web.Response(status=400, text="expected a web socket\n", headers=HEADERS)
        await browser.prepare(request)
        transport = request.transport
        if transport is not None and (own := transport.get_extra_info("socket")) is not None:
            own.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        spectator = Spectator()
        self._stage.welcome(spectator)
        sending = asyncio.create_task(_send(browser, spectator))
        try:
            async for message in browser:
                if message.type != WSMsgType.TEXT:
                    await browser.close(code=WSCloseCode.UNSUPPORTED_DATA, message=b"expected text")
                    break
                self._stage.take(spectator, message.data)
        finally:
            self._stage.audience.leave(spectator)
            sending.cancel()
            with contextlib.suppress(asyncio.CancelledError, ConnectionError):
                await sending
        return browser


async def _send(browser: web.WebSocketResponse, spectator: Spectator) -> None:
    """Sends what is there, and waits where the browser does not read: what comes meanwhile replaces what came."""
    with contextlib.suppress(ConnectionError):
        while True:
            for text in await spectator.next():
                await browser.send_str(text)


def _listener(port: int) -> socket.socket:
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((ADDRESS, port))
    except OSError as error:
        listener.close()
        if error.errno in (errno.EADDRINUSE, errno.EACCES):
            why = "is taken" if error.errno == errno.EADDRINUSE else "may not be used"
            raise ConsoleError(f"port {port} {why}; --port N chooses another, --port 0 a free one") from error
        raise
    return listener
