# SPDX-License-Identifier: Apache-2.0
"""A console attached to a flight that another process flies: the state, the present, and an order to its plant."""

import asyncio
import json
import signal
import subprocess

import aiohttp
from console_process import console

from css_bringup.processes import executable_path

FLY = ("okeefe_2013", "--stay", "--paused", "--no-record")


async def told_until(line, condition):
    """The first message that fulfils a condition."""
    while True:
        message = await line.receive(timeout=120.0)
        assert message.type == aiohttp.WSMsgType.TEXT, message
        told = json.loads(message.data)
        if condition(told):
            return told


def at(told, **wanted):
    return told["type"] == "frame" and "now" in told and all(told["now"].get(k) == v for k, v in wanted.items())


async def drive(address):
    async with aiohttp.ClientSession() as client, client.ws_connect(address + "socket") as line:
        # it came after the epoch was published, and sees it all the same
        first = await told_until(line, lambda told: at(told, time=0.0) and told["now"]["estimates"])
        assert first["now"]["estimates"][0]["name"] == "ekf"
        scene = await told_until(line, lambda told: told["type"] == "scene" and told["craft"]["normals"])
        assert (scene["pace"], scene["director"]) == ("/dynamics", "/flight")
        assert len(scene["craft"]["normals"]) == 24
        await line.send_str('{"id": 1, "do": "rate", "rate": 5}')
        assert (await told_until(line, lambda told: told["type"] == "answer"))["good"]
        await line.send_str('{"id": 2, "do": "resume"}')
        assert (await told_until(line, lambda told: told["type"] == "answer"))["good"]
        frame = await told_until(line, lambda told: at(told) and told["now"]["time"] > 2.0)
        assert frame["pace"]["rate"] == 5.0
        # errors are those of one instant
        assert 0.0 < frame["now"]["estimates"][0]["error_deg"] < 30.0
        await line.send_str('{"id": 3, "do": "set", "node": "/ekf", "name": "gate", "value": 7}')
        refusal = await told_until(line, lambda told: told["type"] == "answer")
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
