# SPDX-License-Identifier: Apache-2.0
"""Flights of a spinning payload in this process."""

from css_analysis.spin_flight import TYPES, SpinFlight, spin_flight
from css_common.mission import Mission
from css_monte_carlo.direct_flight import fly_and_keep


def fly_spinning(mission: Mission) -> SpinFlight:
    """Flies a mission of a spinning payload in this process.

    Raises:
        MissionError: the mission has no such estimators, or cannot fly.
    """
    topics = {kind: [topic for topic, t in mission.topics.items() if t is kind][:1] for kind in TYPES}
    samples = fly_and_keep(mission, [topic for found in topics.values() for topic in found])
    return spin_flight(mission, {kind: samples[found[0]] for kind, found in topics.items() if found})
