# SPDX-License-Identifier: Apache-2.0
"""The server as programs meet it: who is let in, what is answered, and that nobody who does not read holds it up."""

import asyncio
import base64
import json
import os
import socket
from contextlib import asynccontextmanager

import aiohttp
import pytest

from css_console.errors import ConsoleError
from css_console.guards import ADDRESS
from css_console.server import Server
from css_console.stage import Stage, Subject

TOKEN = "the-token-of-this-test"


@pytest.fixture
def serving(made_up_graph):
    """Serves on a free port: the stage, its address, and a client that is no browser."""

    @asynccontextmanager
    async def serve(graph=None):
        stage = Stage(graph or made_up_graph(), Subject("a mission", "flight"))
        async with Server(stage, {}, TOKEN).serving(0) as address, aiohttp.ClientSession() as client:
            yield stage, address, client

    return serve


async def messages_until(line, done):
    """Messages of a socket as objects until one fulfils a condition, that one included."""
    got: list[dict] = []
    while not got or not done(got[-1]):
        message = await line.receive(timeout=60.0)
        assert message.type == aiohttp.WSMsgType.TEXT, message
        got.append(json.loads(message.data))
    return got


def test_the_page_comes_to_its_address_alone(serving):
    async def main():
        async with serving() as (_, address, client):
            answer = await client.get(address)
            assert answer.status == 200
            assert "Sunpoint console" in await answer.text()
            assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
            for part in ("console.js", "body.js", "charts.js", "controls.js", "socket.js", "console.css"):
                assert (await client.get(address + part)).status == 200
            assert (await client.get(address + "server.py")).status == 404
            assert (await client.get(address + "..%2f..%2fserver.py")).status in (403, 404)
            root = address.replace(TOKEN + "/", "")
            for wrong in ("", "wrong/", "wrong/socket", "wrong/console.js"):
                assert (await client.get(root + wrong)).status == 403

    asyncio.run(main())


def test_foreign_pages_and_names_are_refused_though_they_know_the_token(serving):
    async def main():
        async with serving() as (_, address, client):
            for headers in ({"Origin": "http://evil.example"}, {"Origin": "null"}, {"Host": "evil.example"}):
                answer = await client.get(address, headers=headers)
                assert answer.status == 403
                with pytest.raises(aiohttp.WSServerHandshakeError) as refusal:
                    await client.ws_connect(address + "socket", headers=headers)
                assert refusal.value.status == 403
            own = address.split(f"/{TOKEN}")[0]
            async with client.ws_connect(address + "socket", headers={"Origin": own}) as line:
                await messages_until(line, lambda told: told["type"] == "log")

    asyncio.run(main())


def test_it_listens_on_this_machine_alone(serving):
    async def main():
        async with serving() as (_, address, _client):
            port = int(address.split(":")[2].split("/")[0])
            listening = {}
            with open("/proc/net/tcp", encoding="ascii") as table:
                for line in table.readlines()[1:]:
                    place, state = line.split()[1], line.split()[3]
                    if state == "0A" and int(place.split(":")[1], 16) == port:
                        listening[place.split(":")[0]] = True
            assert listening == {"0100007F": True}

    asyncio.run(main())


def test_a_port_that_is_taken_is_said(made_up_graph):
    async def main(port):
        server = Server(Stage(made_up_graph(), Subject("a mission", "flight")), {}, TOKEN)
        with pytest.raises(ConsoleError, match=f"port {port} is taken; --port N"):
            async with server.serving(port):
                pass

    with socket.socket() as other:
        other.bind((ADDRESS, 0))
        other.listen()
        asyncio.run(main(other.getsockname()[1]))


@pytest.mark.parametrize("text", ["nonsense", "[]", '{"do":"explode"}', '{"id":3,"do":"rate","rate":-1}'])
def test_what_is_no_order_is_answered_and_the_line_stays(serving, text):
    async def main():
        async with serving() as (stage, address, client), client.ws_connect(address + "socket") as line:
            await line.send_str(text)
            (*_, answer) = await messages_until(line, lambda told: told["type"] == "answer")
            assert not answer["good"] and "expected" in answer["message"]
            assert stage.refused == 1
            await line.send_str('{"id": 4, "do": "pause", "dry": true}')
            (*_, answer) = await messages_until(line, lambda told: told["type"] == "answer")
            assert answer["commands"] == ["ros2 service call /dynamics/pause std_srvs/srv/Trigger"]

    asyncio.run(main())


def test_bytes_and_what_is_too_long_end_the_line_of_that_browser_alone(serving):
    async def main():
        async with serving() as (stage, address, client), client.ws_connect(address + "socket") as good:
            for send in (lambda line: line.send_bytes(b"\0\1"), lambda line: line.send_str("x" * (1 << 17))):
                async with client.ws_connect(address + "socket") as bad:
                    await send(bad)
                    while (await bad.receive(timeout=60.0)).type == aiohttp.WSMsgType.TEXT:
                        pass
                    assert bad.closed
            await good.send_str('{"id": 1, "do": "step", "dry": true}')
            (*_, answer) = await messages_until(good, lambda told: told["type"] == "answer")
            assert answer["good"]
            assert len(stage.audience) == 1

    asyncio.run(main())


def test_one_who_comes_late_sees_the_state_and_what_was(serving, made_up_graph):
    async def main():
        graph = made_up_graph()
        async with serving(graph) as (stage, address, client):
            for k in range(50):
                graph.fly(0.1 * k, 1.0 + k)
                stage.look()
            async with client.ws_connect(address + "socket") as line:
                got = await messages_until(line, lambda told: told["type"] == "log")
                by_type = {told["type"]: told for told in got}
                assert by_type["scene"]["subject"]["title"] == "a mission"
                assert by_type["frame"]["now"]["time"] == pytest.approx(4.9)
                assert by_type["history"]["columns"] == [
                    [pytest.approx(0.1 * k) for k in range(50)],
                    [1.0 + k for k in range(50)],
                ]
                assert by_type["nodes"]["nodes"][0]["node"] == "/dynamics"

    asyncio.run(main())


async def frozen(address):
    """A browser that shakes hands and reads nothing more, with the smallest of buffers."""
    host, port = address.split("/")[2].split(":")
    line = socket.socket()
    line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    line.setblocking(False)
    loop = asyncio.get_running_loop()
    await loop.sock_connect(line, (host, int(port)))
    key = base64.b64encode(os.urandom(16)).decode()
    request = f"GET /{TOKEN}/socket HTTP/1.1\r\nHost: {host}:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    request += f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n"
    await loop.sock_sendall(line, request.encode())
    assert (await loop.sock_recv(line, 12)) == b"HTTP/1.1 101"
    return line


def test_one_who_does_not_read_holds_nobody_up_and_costs_no_memory(serving, made_up_graph):
    async def main():
        graph = made_up_graph(bulk=20_000)
        async with serving(graph) as (stage, address, client):
            line = await frozen(address)
            async with client.ws_connect(address + "socket") as good:
                await messages_until(good, lambda told: told["type"] == "log")
                seen = 0
                for k in range(1, 1001):
                    graph.fly(0.1 * k, 1.0)
                    stage.look()
                    await asyncio.sleep(0)
                    if k % 50 == 0:
                        (*_, last) = await messages_until(
                            good, lambda told, k=k: told["type"] == "frame" and told["number"] >= k
                        )
                        seen = last["number"]
                assert seen == 1000
                worst = max(stage.audience.spectators, key=lambda one: one.replaced)
                # 20 MB were shown; what the middle of the line holds is far less, and the rest was replaced
                assert worst.replaced > 700
                assert worst.waiting <= 5
            line.close()

    asyncio.run(main())


def test_a_look_that_fails_ends_the_server_with_its_reason(made_up_graph):
    graph = made_up_graph()
    looks = []

    def look():
        looks.append(1)
        if len(looks) == 3:
            raise RuntimeError("the graph is gone")
        return False

    graph.look = look
    server = Server(Stage(graph, Subject("a mission", "flight")), {}, TOKEN)

    async def main():
        await server.look_until(asyncio.Event())

    with pytest.raises(RuntimeError, match="the graph is gone"):
        asyncio.run(main())
    assert len(looks) == 3


def test_looks_end_when_they_are_told_to(made_up_graph):
    graph, over, looks = made_up_graph(), asyncio.Event(), []

    def look():
        looks.append(1)
        if len(looks) == 2:
            over.set()
        return False

    graph.look = look
    asyncio.run(Server(Stage(graph, Subject("a mission", "flight")), {}, TOKEN).look_until(over))
    assert len(looks) == 2
