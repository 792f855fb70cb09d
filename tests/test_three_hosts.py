# SPDX-License-Identifier: Apache-2.0
"""Simulation, estimation and control on three hosts whose link is cut: nothing of the flight is lost but time.

For how long, and every host in turn: `benchmarks/three_hosts.py`.
"""

import json
import subprocess
import sys

import pytest
from listing import ROOT

sys.path.insert(0, str(ROOT / "benchmarks"))

import hosts


def test_a_flight_goes_on_when_the_link_comes_back():
    reason = hosts.refusal()
    if reason:
        pytest.skip(reason)
    options = ["--duration", "60", "--factor", "10", "--cut", "estimation", "--cut-s", "3"]
    flown = subprocess.run(
        [sys.executable, str(ROOT / "benchmarks" / "three_hosts.py"), *options],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    undisturbed, cut = json.loads(flown.stdout.splitlines()[-1])
    for outcome in (undisturbed, cut):
        assert outcome["failure"] == "", outcome
        assert outcome["steps"] == outcome["expected_steps"] == 600
        assert outcome["lost_messages"] == {} and outcome["partners_lost"] == 0
        assert outcome["power_positive_s"] is not None
    assert cut["cut_s"] >= 3.0 and undisturbed["cut_s"] == 0.0
