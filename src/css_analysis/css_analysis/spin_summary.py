# SPDX-License-Identifier: Apache-2.0
"""What people and scripts read of a flight of a spinning payload."""

import math
from typing import Any

import numpy as np

from css_analysis.spin_flight import SpinFlight
from css_common.codec import Sample
from css_msgs.msg import ConingEstimate

_CHOICES = {
    ConingEstimate.CHOICE_ONLY: "the only one that a rigid body can have",
    ConingEstimate.CHOICE_INERTIA: "by the ratio of moments of inertia",
    ConingEstimate.CHOICE_EVENTS: "by the motion that explains the pulses",
    ConingEstimate.CHOICE_POWER: "by power, which is no proof",
}


def spin_object(flight: SpinFlight) -> dict[str, Any]:
    """The flight as plain data."""
    return {
        "passages": len(flight.passages.time),
        "refused": flight.refused,
        "attitudes": len(flight.attitudes),
        "legs": [_leg_object(leg, estimate) for leg, estimate in sorted(flight.coning.items())],
    }


def spin_lines(flight: SpinFlight) -> list[str]:
    """The flight in a few lines."""
    rate = flight.passages.rate / (2.0 * np.pi)
    spread = f", rotation rate {rate.min():.3f} to {rate.max():.3f} Hz" if len(rate) else ""
    lines = [
        f"{len(rate)} passages through the slits{spread}; {flight.refused} pulses or passages refused; "
        f"{len(flight.attitudes)} attitudes"
    ]
    for leg, c in sorted(flight.coning.items()):
        candidates = ", ".join(f"{f:.3f}" for f in c.frequency[: c.candidates])
        lines.append(
            f"leg {leg}: spin {c.spin:.3f} Hz, coning full angle {math.degrees(c.full_angle):.2f} deg (maxima less "
            f"minima {math.degrees(c.max_min_angle):.2f}), period {c.period:.4f} s chosen "
            f"{_CHOICES[c.choice]} from {candidates} Hz"
        )
    return lines


def _leg_object(leg: int, c: Sample) -> dict[str, Any]:
    return {
        "leg": leg,
        "spin_hz": c.spin,
        "full_angle_deg": math.degrees(c.full_angle),
        "max_min_angle_deg": math.degrees(c.max_min_angle),
        "period_s": c.period,
        "fft_period_s": c.fft_period,
        "candidates_hz": c.frequency[: c.candidates].tolist(),
        "chosen": int(c.chosen),
    }
