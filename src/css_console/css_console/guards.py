# SPDX-License-Identifier: Apache-2.0
"""Who may talk to the console: pages that it gave itself, on this machine, with its token."""

import secrets
from collections.abc import Mapping

ADDRESS = "127.0.0.1"
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}
"""Of every answer: nothing from elsewhere in the page, the page nowhere else, and its address told to nobody."""


def new_token() -> str:
    """The part of the address that only who was told it knows."""
    return secrets.token_urlsafe(24)


class Guard:
    """Looks at each request before anything else does."""

    def __init__(self, port: int, token: str) -> None:
        """Of a server on a port of this machine."""
        self._token = token
        self._hosts = {f"{name}:{port}" for name in (ADDRESS, "localhost")}
        self._origins = {f"http://{host}" for host in self._hosts}

    def refusal(self, headers: Mapping[str, str], token: str) -> str:
        """Why a request is refused, empty: it is not.

        A foreign page can have a browser send requests here, and a name of its own lead here, but can forge neither
        header. Programs that are no browsers send no origin; the token alone stands between them and the flight.

        Args:
            headers: of the request, whose names are found in any case.
            token: the part of the path where it belongs.
        """
        host, origin = headers.get("Host", ""), headers.get("Origin")
        if host not in self._hosts:
            return f"Host: {host[:80]!r} given, expected {' or '.join(sorted(self._hosts))}"
        if origin is not None and origin not in self._origins:
            return f"Origin: {origin[:80]!r} given, expected a page of this console"
        if not secrets.compare_digest(token.encode(), self._token.encode()):
            return "the address lacks the token; the console printed the whole of it when it began"
        return ""
