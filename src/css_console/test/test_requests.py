# SPDX-License-Identifier: Apache-2.0
"""What the console asks other nodes: an answer each, or why there is none."""

from types import SimpleNamespace
from typing import Any

import pytest

from css_console import requests
from css_console.requests import PATIENCE_S, Requests


class Future:
    def __init__(self):
        self.answer: Any = None

    def done(self):
        return self.answer is not None

    def result(self):
        return self.answer


class Client:
    """Of a service that is found, and answers, when a test says so."""

    def __init__(self, kind, name):
        self.kind, self.srv_name, self.ready = kind, name, False
        self.calls: list[tuple[Any, Future]] = []
        self.removed: list[Future] = []

    def service_is_ready(self):
        return self.ready

    def call_async(self, request):
        self.calls.append((request, Future()))
        return self.calls[-1][1]

    def remove_pending_request(self, future):
        self.removed.append(future)


@pytest.fixture
def clients():
    return []


@pytest.fixture
def asked(clients, monkeypatch):
    """Requests of a node, a clock to be set, and what was answered and given up."""

    def create_client(kind, name):
        clients.append(Client(kind, name))
        return clients[-1]

    clock = SimpleNamespace(now=100.0)
    monkeypatch.setattr(requests.time, "monotonic", lambda: clock.now)
    node: Any = SimpleNamespace(create_client=create_client)
    return SimpleNamespace(of=Requests(node), clock=clock, answers=[], reasons=[])


def ask(asked, service="/dynamics/pause", kind=int, request="now"):
    asked.of.ask(service, kind, request, asked.answers.append, asked.reasons.append)


def test_a_request_is_sent_once_its_service_is_found_and_answered_once(asked, clients):
    ask(asked)
    (client,) = clients
    assert (client.kind, client.srv_name, client.calls) == (int, "/dynamics/pause", []) and asked.of.pending
    client.ready = True
    asked.of.look()
    asked.of.look()
    ((request, future),) = client.calls
    assert request == "now" and asked.of.pending and asked.answers == []
    future.answer = "done"
    asked.of.look()
    asked.of.look()
    assert asked.answers == ["done"] and asked.reasons == [] and not asked.of.pending


def test_a_service_has_one_client_and_each_request_its_own_answer(asked, clients):
    ask(asked, request="first")
    ask(asked, request="second")
    ask(asked, "/dynamics/resume")
    ask(asked, kind=float)
    assert [(client.srv_name, client.kind) for client in clients] == [
        ("/dynamics/pause", int), ("/dynamics/resume", int), ("/dynamics/pause", float),
    ]  # fmt: skip
    clients[0].ready = True
    asked.of.look()
    assert [request for request, _ in clients[0].calls] == ["first", "second"]
    clients[0].calls[1][1].answer = "to the second"
    asked.of.look()
    assert asked.answers == ["to the second"] and asked.of.pending


def test_a_service_that_is_ready_is_asked_at_once(asked, clients):
    ask(asked)
    clients[0].ready = True
    ask(asked, request="again")
    assert [request for request, _ in clients[0].calls] == ["now", "again"]


@pytest.mark.parametrize(("ready", "why"), [(False, "is not there"), (True, "does not answer for 10 s")])
def test_patience_ends_and_says_with_what(asked, clients, ready, why):
    ask(asked)
    clients[0].ready = ready
    asked.of.look()
    asked.clock.now += PATIENCE_S
    asked.of.look()
    assert asked.reasons == [] and asked.of.pending
    asked.clock.now += 0.1
    asked.of.look()
    asked.of.look()
    assert asked.reasons == [f"/dynamics/pause {why}"] and asked.answers == [] and not asked.of.pending
    assert [future for _, future in clients[0].calls] == clients[0].removed
