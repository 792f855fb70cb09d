# SPDX-License-Identifier: Apache-2.0
"""The console beside a flight: server and watcher in a thread of their own, whose failure ends the process."""

import asyncio
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from css_common.output_port import OutputPort
from css_console.errors import ConsoleError
from css_console.server import Server
from css_console.stage import Stage, Subject
from css_console.watcher import Watcher

_START_S = 60.0


class ConsoleThread:
    """Serves inside the context.

    Attributes:
        address: of the page, with its token.
        failure: what ended the thread before its time; None: nothing did.
    """

    def __init__(
        self,
        subject: Subject,
        libraries: Mapping[str, Path],
        token: str,
        port: int,
        fallback: Mapping[str, Any] | None = None,
        begin_ns: int | None = None,
        failed: Callable[[], object] = lambda: None,
        *,
        begins: bool = False,
        inside: Callable[[], Mapping[str, OutputPort]] = dict,
    ) -> None:
        """Prepares.

        Args:
            subject: what the page is about.
            libraries: files of JavaScript libraries by their served name.
            token: part of the address.
            port: on this machine; 0: a free one.
            fallback: parameters of the mission, for a graph whose nodes tell none.
            begin_ns: stamp from which seconds count; None: the epoch that the nodes tell.
            failed: called from the thread when it fails after its start.
            begins: let time go on, which is held at the beginning, when the first browser is there.
            inside: what nodes of this process publish now, by full name.
        """
        self.address = ""
        self.failure: BaseException | None = None
        self._subject, self._libraries, self._token, self._port = subject, libraries, token, port
        self._fallback, self._begin_ns, self._inside = fallback, begin_ns, inside
        self._failed, self._begins = failed, begins
        self._serves = threading.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._over: asyncio.Event | None = None
        self._thread = threading.Thread(target=self._run, name="console", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        self._serves.wait(_START_S)
        if not self.address:
            self._thread.join(1.0)
            raise self.failure or ConsoleError(f"the console does not serve after {_START_S:g} s")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._loop is not None and self._over is not None and self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._over.set)
        self._thread.join(10.0)

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except BaseException as error:  # handed to the thread that waits for it
            self.failure = error
            if self._serves.is_set():
                self._failed()
        finally:
            self._serves.set()

    async def _serve(self) -> None:
        self._loop, self._over = asyncio.get_running_loop(), asyncio.Event()
        watcher = Watcher(self._fallback, self._begin_ns, self._inside)
        try:
            server = Server(Stage(watcher, self._subject, begins=self._begins), self._libraries, self._token)
            async with server.serving(self._port) as self.address:
                self._serves.set()
                await server.look_until(self._over)
        finally:
            watcher.close()
