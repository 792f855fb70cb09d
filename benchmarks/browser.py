# SPDX-License-Identifier: Apache-2.0
"""A headless Chromium that pages are looked at with, over the pipes of its remote debugging: no driver is needed."""

import base64
import json
import os
import select
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
_PATIENCE_S = 120.0


def browser_path() -> str | None:
    """The browser of this machine; None: there is none. `SUNPOINT_BROWSER` names another."""
    named = os.environ.get("SUNPOINT_BROWSER")
    return named or next(filter(None, map(shutil.which, NAMES)), None)


class BrowserError(Exception):
    """The browser does not do what it is asked for; the message says what."""


class Browser:
    """One page in a browser of its own."""

    def __init__(self, path: str, width: int, height: int = 900) -> None:
        self._profile = tempfile.TemporaryDirectory(prefix="browser-")
        reads, self._to = os.pipe()
        self._from, writes = os.pipe()

        def take_pipes() -> None:
            os.dup2(reads, 3)
            os.dup2(writes, 4)

        # the browser talks on 3 and 4; none of ours may be there before
        reads, writes = (self._above(end) for end in (reads, writes))
        self._process = subprocess.Popen(
            [
                path, "--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--remote-debugging-pipe",
                "--no-first-run", "--disable-background-networking", f"--user-data-dir={self._profile.name}",
                f"--window-size={width},{height}", "about:blank",
            ],
            preexec_fn=take_pipes, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(reads)
        os.close(writes)
        self._rest, self._number, self._session = b"", 0, ""
        self.events: list[dict[str, Any]] = []
        pages = self.call("Target.getTargets")["targetInfos"]
        target = next(page["targetId"] for page in pages if page["type"] == "page")
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 500
        )

    @staticmethod
    def _above(end: int) -> int:
        moved = os.dup(end) if end < 10 else end
        held = []
        while moved < 10:
            held.append(moved)
            moved = os.dup(end)
        for other in {*held, end} - {moved}:
            os.close(other)
        os.set_inheritable(moved, True)
        return moved

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """What a method of the protocol gives.

        Raises:
            BrowserError: it refuses, or does not answer.
        """
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next(method)
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise BrowserError(f"{method}: {answer['error'].get('message')}")
                return answer["result"]
            self.events.append(answer)

    def _next(self, what: str) -> dict[str, Any]:
        deadline = time.monotonic() + _PATIENCE_S
        while b"\0" not in self._rest:
            ready, _, _ = select.select([self._from], [], [], max(deadline - time.monotonic(), 0.0))
            data = os.read(self._from, 1 << 20) if ready else b""
            if not data:
                raise BrowserError(f"{what}: the browser {'ended' if ready else 'is silent'}")
            self._rest += data
        message, _, self._rest = self._rest.partition(b"\0")
        return json.loads(message)

    def evaluate(self, expression: str) -> Any:
        """The value of an expression in the page, awaited if it is a promise.

        Raises:
            BrowserError: it throws.
        """
        result = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in result:
            raise BrowserError(json.dumps(result["exceptionDetails"])[:2000])
        return result["result"].get("value")

    def open(self, page: Path | str) -> None:
        """Opens a file or an address, and waits until it has loaded."""
        self.events.clear()
        self.call("Page.navigate", url=page if isinstance(page, str) else page.absolute().as_uri())
        deadline = time.monotonic() + _PATIENCE_S
        while not any(event.get("method") == "Page.loadEventFired" for event in self.events):
            if time.monotonic() > deadline:
                raise BrowserError(f"{page}: not loaded after {_PATIENCE_S:g} s")
            self.events.append(self._next("load"))

    def until(self, condition: str, what: str, seconds: float = 270.0) -> None:
        """Waits for an expression to be true, looked at again and again in the page.

        Args:
            condition: the expression.
            what: it means, for the message.
            seconds: wall time after which it is taken for one that never comes; a machine under load takes its time.

        Raises:
            BrowserError: it does not come to be; names it.
        """
        ends = time.monotonic() + seconds
        while not self.evaluate(
            "new Promise((done) => { const ends = performance.now() + 10000; const look = () => {"
            f"const came = Boolean({condition}); if (came || performance.now() > ends) done(came);"
            "else setTimeout(look, 30); }; look(); })"
        ):
            if time.monotonic() > ends:
                raise BrowserError(f"never came to be: {what}")

    @property
    def complaints(self) -> list[str]:
        """Errors and warnings of the console so far."""
        self.evaluate("1")
        found = []
        for event in self.events:
            method, parameters = event.get("method"), event.get("params", {})
            if method == "Runtime.exceptionThrown":
                details = parameters["exceptionDetails"]
                found.append(str(details.get("exception", {}).get("description", details.get("text"))))
            elif method == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "warning", "assert"):
                found.append(" ".join(str(a.get("value", a.get("description"))) for a in parameters["args"]))
            elif method == "Log.entryAdded" and parameters["entry"]["level"] in ("error", "warning"):
                found.append(parameters["entry"]["text"])
        return found

    @property
    def requests(self) -> list[str]:
        """Addresses that the page asked for, itself and data in it apart."""
        self.evaluate("1")
        asked = [e["params"]["request"]["url"] for e in self.events if e.get("method") == "Network.requestWillBeSent"]
        return [url for url in asked[1:] if not url.startswith(("data:", "blob:"))]

    def cpu_s(self) -> float:
        """Processor time [s] of the browser and all of its processes so far."""
        return sum(self._processes().values()) / os.sysconf("SC_CLK_TCK")

    def freeze(self) -> None:
        """Stops all of its processes, as a debugger or a laptop that sleeps does."""
        for pid in self._processes():
            os.kill(pid, signal.SIGSTOP)

    def thaw(self) -> None:
        """Lets them go on."""
        for pid in self._processes():
            os.kill(pid, signal.SIGCONT)

    def _processes(self) -> dict[int, int]:
        """Its processes, with their processor time in ticks."""
        parents: dict[int, int] = {}
        ticks: dict[int, int] = {}
        for stat in Path("/proc").glob("[0-9]*/stat"):
            try:
                fields = stat.read_text().rpartition(")")[2].split()
            except OSError:
                continue  # it has just ended
            parents[int(stat.parent.name)] = int(fields[1])
            ticks[int(stat.parent.name)] = int(fields[11]) + int(fields[12])
        own = {self._process.pid}
        while new := {pid for pid, parent in parents.items() if parent in own} - own:
            own |= new
        return {pid: ticks[pid] for pid in own if pid in ticks}

    def screenshot(self, file: Path, *, whole: bool = False) -> None:
        """What is in view as PNG, or the whole page."""
        shot = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        file.write_bytes(base64.b64decode(shot["data"]))

    def pdf(self, file: Path) -> None:
        """The page as it is printed."""
        file.write_bytes(base64.b64decode(self.call("Page.printToPDF", printBackground=True)["data"]))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.terminate()
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._to)
        os.close(self._from)
        shutil.rmtree(self._profile.name, ignore_errors=True)
