# SPDX-License-Identifier: Apache-2.0
"""Who may talk to the console."""

import pytest

from css_console.guards import Guard, new_token

GUARD = Guard(8765, "secret")


@pytest.mark.parametrize("host", ["127.0.0.1:8765", "localhost:8765"])
@pytest.mark.parametrize("origin", [None, "http://127.0.0.1:8765", "http://localhost:8765"])
def test_pages_of_its_own_and_programs_that_know_the_token(host, origin):
    headers = {"Host": host} | ({} if origin is None else {"Origin": origin})
    assert GUARD.refusal(headers, "secret") == ""


@pytest.mark.parametrize("host", ["", "evil.example:8765", "127.0.0.1", "127.0.0.1:80", "127.0.0.1.evil.example:8765"])
def test_a_foreign_host_is_refused_though_the_token_is_right(host):
    assert GUARD.refusal({"Host": host}, "secret").startswith("Host: ")


@pytest.mark.parametrize(
    "origin", ["null", "", "http://evil.example", "https://127.0.0.1:8765", "http://127.0.0.1:8766", "file://"]
)
def test_a_foreign_origin_is_refused_though_the_token_is_right(origin):
    assert GUARD.refusal({"Host": "127.0.0.1:8765", "Origin": origin}, "secret").startswith("Origin: ")


@pytest.mark.parametrize("token", ["", "Secret", "secret ", "sécret", "secrets"])
def test_without_the_token_nothing_is_given(token):
    assert "token" in GUARD.refusal({"Host": "127.0.0.1:8765"}, token)


def test_tokens_differ_and_are_long():
    tokens = {new_token() for _ in range(100)}
    assert len(tokens) == 100
    assert min(map(len, tokens)) >= 32
