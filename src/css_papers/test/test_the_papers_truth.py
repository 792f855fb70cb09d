# SPDX-License-Identifier: Apache-2.0
"""The missions of the papers fly under the truth of the papers: nothing that makes it harder is on."""

import pytest

from css_common.mission import load_mission

PAPERS = ["okeefe_2013", "clark_1996_flat", "clark_1996_pyramid", "cubesat_vmm", "esprit_2006"]
HARDER = (
    "mission.epoch_spread_days",
    "orbit.model",
    "dispersion.orbit.",
    "dispersion.friction",
    "friction.",
    "tachometer.",
    "latency",
    "albedo.drift",
    "albedo.renewal_h",
)


@pytest.mark.parametrize("name", PAPERS)
def test_nothing_that_makes_the_truth_harder_is_on(name):
    mission = load_mission(name)
    seen = set()
    for node in mission.nodes:
        for parameter in node.component.table():
            if parameter.name.startswith(HARDER):
                seen.add(parameter.name)
                assert node.canonical[parameter.name] == parameter.default, f"{node.name}.{parameter.name}"
    assert {"mission.epoch_spread_days", "orbit.model"} <= seen
