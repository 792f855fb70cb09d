# SPDX-License-Identifier: Apache-2.0
"""Some of the rubbish of `benchmarks/fuzz.py`: each is taken, or refused in one line by a node that works on."""

import sys

from listing import ROOT

sys.path.insert(0, str(ROOT / "benchmarks"))

import fuzz

COUNT = 800


def test_messages_parameters_requests_and_faults():
    trial = fuzz.run(COUNT, seed=5)
    assert trial.failures == []
    # both ways out are tried for each kind
    for kind in ("messages", "faults", "requests", "parameters"):
        taken, refused = (trial.counts[f"{kind} {said}"] for said in ("taken", "refused"))
        assert min(taken, refused) >= COUNT // 80, (kind, trial.counts)
        assert taken + refused == COUNT // 4
