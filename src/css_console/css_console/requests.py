# SPDX-License-Identifier: Apache-2.0
"""Requests to services of other nodes, whose answers come when they come; what is not answered in time is said."""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

from rclpy.client import Client
from rclpy.node import Node

PATIENCE_S = 10.0
"""Wall time [s] for an answer; loading another mission takes a good part of one."""


class _Pending(NamedTuple):
    client: Client
    request: Any
    answered: Callable[[Any], None]
    given_up: Callable[[str], object]
    limit: float


class Requests:
    """Of one node. Everything runs in the thread that calls `look`."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._clients: dict[tuple[str, type], Client] = {}
        self._waiting: list[_Pending] = []  # for their service to be found
        self._sent: list[tuple[_Pending, Any]] = []

    @property
    def pending(self) -> bool:
        """Something was asked that has no answer yet."""
        return bool(self._waiting or self._sent)

    def ask(
        self,
        service: str,
        kind: type,
        request: Any,
        answered: Callable[[Any], None],
        given_up: Callable[[str], object] = lambda why: None,
    ) -> None:
        """Asks; what comes of it is handed on from `look`.

        Args:
            service: full name.
            kind: type of the service.
            request: of that type.
            answered: called with the answer.
            given_up: called with the reason when there is none.
        """
        key = (service, kind)
        if key not in self._clients:
            self._clients[key] = self._node.create_client(kind, service)
        limit = time.monotonic() + PATIENCE_S
        self._waiting.append(_Pending(self._clients[key], request, answered, given_up, limit))
        self.look()

    def look(self) -> None:
        """Sends what can be sent, hands on what was answered, and gives up what has waited too long."""
        now = time.monotonic()
        waiting, self._waiting = self._waiting, []
        for pending in waiting:
            if pending.client.service_is_ready():
                self._sent.append((pending, pending.client.call_async(pending.request)))
            elif now > pending.limit:
                pending.given_up(f"{pending.client.srv_name} is not there")
            else:
                self._waiting.append(pending)
        sent, self._sent = self._sent, []
        for pending, future in sent:
            if future.done():
                pending.answered(future.result())
            elif now > pending.limit:
                pending.client.remove_pending_request(future)
                pending.given_up(f"{pending.client.srv_name} does not answer for {PATIENCE_S:g} s")
            else:
                self._sent.append((pending, future))
