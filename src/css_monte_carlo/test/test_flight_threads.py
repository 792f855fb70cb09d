# SPDX-License-Identifier: Apache-2.0
"""Flights in threads end soon once an exception ends the wait for them, and only then."""

import threading
import time
from contextlib import suppress

import pytest

from css_common.mission import load_mission
from css_common.testing import DEADLINE
from css_monte_carlo.direct_flight import fly_checked
from css_monte_carlo.flight_threads import FlightThreads, GivenUp, go_on_if_waited_for


def look_until_told(began: threading.Event) -> bool:
    began.set()
    end = time.monotonic() + DEADLINE
    while time.monotonic() < end:
        go_on_if_waited_for()
    return True


def test_an_exception_gives_up_what_flies_and_what_waits():
    began = threading.Event()
    with suppress(KeyboardInterrupt), FlightThreads(1) as threads:
        flying, waiting = threads.submit(look_until_told, began), threads.submit(look_until_told, threading.Event())
        assert began.wait(DEADLINE)
        raise KeyboardInterrupt
    assert isinstance(flying.exception(), GivenUp)
    assert waiting.cancelled()


def test_all_that_was_asked_for_flies_to_its_end_otherwise():
    with FlightThreads(2) as threads:
        asked = [threads.submit(go_on_if_waited_for) for _ in range(10)]
    assert all(one.exception() is None for one in asked)


def test_pools_do_not_know_of_each_other():
    with FlightThreads(1) as other:
        with pytest.raises(ValueError, match="one of them"), FlightThreads(1):
            raise ValueError("one of them")
        assert other.submit(go_on_if_waited_for).exception() is None
    go_on_if_waited_for()  # this thread is of no pool


def test_a_flight_node_by_node_looks_too():
    mission = load_mission("okeefe_2013").with_overrides(["mission.duration=3600.0"])
    began = threading.Event()

    def fly() -> None:
        began.set()
        fly_checked(mission)

    with suppress(KeyboardInterrupt), FlightThreads(1) as threads:
        flying = threads.submit(fly)
        assert began.wait(DEADLINE)
        raise KeyboardInterrupt
    assert isinstance(flying.exception(), GivenUp)
