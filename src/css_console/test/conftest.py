# SPDX-License-Identifier: Apache-2.0
"""Provides what the console fetches when it is first asked for, before tests that import it are loaded."""

import warnings
from types import SimpleNamespace

import pytest
from console_process import WITHOUT

from css_console.calls import Known
from css_console.frames import Frame
from css_console.history import History
from css_console.inventory import Inventory

if WITHOUT:
    warnings.warn(f"the tests of the console are left out: {WITHOUT}", stacklevel=1)
    collect_ignore_glob = ["test_*.py"]


class Graph:
    """Stands in for the watcher: an instant is what `fly` says, calls are kept instead of made."""

    def __init__(self, bulk=0):
        self.inventory = Inventory(pace="/dynamics", director="/flight", faulty=("/css_array",))
        self.parameters = SimpleNamespace(version=0, table=lambda: [])
        self.known = Known("/dynamics", "", "/flight")
        self.series = [{"chart": "heading", "name": "ekf error", "unit": "deg"}]
        self.history, self.frame = History(1), None
        self.version = self.flights = 0
        self.performed = []
        self._bulk, self._fresh = "x" * bulk, False

    def fly(self, time_s, error_deg):
        self.frame = Frame({"time": time_s, "bulk": self._bulk}, [error_deg], (("heading", "ekf error", "deg"),))
        self.history.add(time_s, [error_deg])
        self._fresh = True

    def look(self):
        fresh, self._fresh = self._fresh, False
        return fresh

    def factor(self):
        return 10.0

    def pace(self):
        return {"node": "/dynamics", "paused": False, "rate": 10.0, "state": "active"}

    def nodes(self):
        return [{"node": "/dynamics", "state": "active", "level": "ok", "message": "active", "counters": {}}]

    def director(self):
        return {"node": "/flight", "message": "flying"}

    def faults(self):
        return ["css_array: cell.0 dead from=3"]

    def parameter(self, name):
        return None

    def columns(self):
        return self.history.columns().tolist()

    def perform(self, calls, done):
        self.performed.append((calls, done))


@pytest.fixture
def made_up_graph():
    """The class of graphs that are made up."""
    return Graph
