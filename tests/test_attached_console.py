# SPDX-License-Identifier: Apache-2.0
"""A console attached to a flight that another process flies: the state, the present, and an order to its plant."""

import asyncio
import json
import signal
import subprocess

import pytest
from console_process import WITHOUT, console

from css_bringup.processes import executable_path

aiohttp = pytest.importorskip("aiohttp", reason=WITHOUT)
pytestmark = [
    pytest.mark.skipif(bool(WITHOUT), reason=WITHOUT),
    pytest.mark.timeout(600),  # its flight compiles what no test before it has
]
FLY = ("okeefe_2013", "--stay", "--paused", "--no-record")


class Line:
    """What a console tells a browser, the latest of each type."""

    def __init__(self, socket):
        self.latest = {}
        self._socket = socket

    async def until(self, kind, condition=lambda told: True):
        """The latest of a type once it fulfils a condition."""
        while not (kind in self.latest and condition(self.latest[kind])):
            message = await self._socket.receive(timeout=120.0)
            assert message.type == aiohttp.WSMsgType.TEXT, message
            told = json.loads(message.data)
            self.latest[told["type"]] = told
        return self.latest[kind]

    async def order(self, number, **fields):
        """The answer to an order."""
        await self._socket.send_str(json.dumps({"id": number, **fields}))
        return await self.until("answer", lambda told: told["id"] == number)


async def drive(address):
    async with aiohttp.ClientSession() as client, client.ws_connect(address + "socket") as socket:
        line = Line(socket)
        # it came after the epoch was published, and sees it all the same
        first = await line.until("frame", lambda told: "now" in told and told["now"]["estimates"])
        assert (first["now"]["time"], first["now"]["estimates"][0]["name"]) == (0.0, "ekf")
        scene = await line.until("scene", lambda told: told["craft"]["normals"] and told["director"])
        assert (scene["pace"], scene["director"], len(scene["craft"]["normals"])) == ("/dynamics", "/flight", 24)
        assert (await line.order(1, do="rate", rate=5))["good"]
        assert (await line.order(2, do="resume"))["good"]
        frame = await line.until("frame", lambda told: told["now"]["time"] > 2.0)
        assert frame["pace"]["rate"] == 5.0
        # errors are those of one instant
        assert 0.0 < frame["now"]["estimates"][0]["error_deg"] < 30.0
        refusal = await line.order(3, do="set", node="/ekf", name="gate", value=7)
        assert not refusal["good"] and "gate" in refusal["message"]


def test_it_shows_and_drives_what_it_did_not_start():
    command = [executable_path("css_bringup", "fly"), *FLY]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as fly:
        try:
            with console("--attach") as running:
                asyncio.run(drive(running.address))
            # the console is gone, the flight is not
            assert fly.poll() is None
        finally:
            fly.send_signal(signal.SIGINT)
            fly.wait(60.0)
