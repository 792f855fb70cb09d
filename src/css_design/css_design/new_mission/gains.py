# SPDX-License-Identifier: Apache-2.0
"""Gains of the Sun-pointing control from inertia, wheels and control cycle.

Near the Sun the loop about an axis of moment I is I theta'' + P theta' + K/4 theta = 0, so that a bandwidth w and a
damping ratio z ask for K = 4 I w^2 and P = 2 z I w. I is the largest moment: about the others the loop is faster and
damped as well or better. The bandwidth is the least of what

    the wheels' torque bears: K tan(90 deg / 4), the command 90 deg off, is what they can give in every direction;
    the wheels' momentum bears: a turn from far off settles at K/P tan(angle / 4), at most 2 w / z, and half of the
        momentum is left for it;
    the estimate bears: a fifth of the corner of the low-pass on the rate, that lags behind;
    the sampling bears: the sampled loop, with estimator and delay, keeps a gain margin of 12 dB.
"""

import math
from typing import NamedTuple

import numpy as np

from css_design.errors import DesignError
from sunpoint_control.loop_stability import Gains, LoopModel, fastest_growth
from sunpoint_control.wheel_allocation import pseudo_inverse

DAMPING = 0.9
"""Damping ratio about the axis of the largest moment."""

LEAST_MARGIN_DB = 12.0
"""Gain margin of a loop that is made here; twice what the checks before a flight ask for."""

_FARTHEST_LINEAR = math.tan(math.radians(90.0) / 4.0)  # MRP of the error up to which the torque is not saturated
_SHARE_OF_MOMENTUM = 0.5
_BELOW_CORNER = 0.2
_MOST_DB = 60.0
_STABLE = 1.0 + 1e-6  # of `loop_stability`
_SLOWEST = 1e-5  # [rad/s]


class Capacity(NamedTuple):
    """What a set of wheels can do in every direction."""

    torque: float  # [N m]
    momentum: float  # [N m s]


class Loop(NamedTuple):
    """Gains, and what they make of the loop."""

    gains: Gains
    bandwidth: float  # [rad/s] about the axis of the largest moment
    limit: str  # what the bandwidth is limited by
    margin_db: float  # gain margin, at most 60
    settling_s: float  # time in which a small error falls to 2 %


def capacity(axes: np.ndarray, torque: float, momentum: float) -> Capacity:
    """What wheels about axes (N, 3) with these limits can do in the direction in which they can do least.

    A torque of size t in direction d asks at most t times the largest row norm of the pseudo-inverse of one wheel.
    """
    shares = np.linalg.norm(pseudo_inverse(axes, ()), axis=1)
    return Capacity(torque / float(shares.max()), momentum / float(shares.max()))


def gain_margin_db(model: LoopModel, gains: Gains) -> float:
    """Factor [dB] by which the whole loop may answer more strongly before it is unstable, at most 60; -inf: it is.

    A body of a fraction of the inertia answers as much more strongly.
    """
    if not _is_stable(model, gains, 1.0):
        return -math.inf
    low, high = 0.0, _MOST_DB
    if _is_stable(model, gains, 10.0 ** (high / 20.0)):
        return high
    while high - low > 0.01:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _is_stable(model, gains, 10.0 ** (middle / 20.0)) else (low, middle)
    return low


def _is_stable(model: LoopModel, gains: Gains, factor: float) -> bool:
    stiffer = model._replace(inertia=model.inertia / factor)
    inner = gains._replace(ki=gains.ki * factor)  # the same law on a body that answers so much more strongly
    damping = gains._replace(k=0.0, ki=0.0)
    return max(fastest_growth(stiffer, inner), fastest_growth(stiffer, damping)) <= _STABLE


def designed(model: LoopModel, wheels: Capacity, corner_hz: float) -> Loop:
    """The loop of a spacecraft.

    Args:
        model: inertia, cycle, estimator and delay.
        wheels: what they can do in every direction.
        corner_hz: corner of the low-pass on the rate.

    Raises:
        DesignError: no gains keep the margin.
    """
    moments = np.linalg.eigvalsh(model.inertia)
    largest = float(moments[2])
    limits = {
        "the torque of the wheels": math.sqrt(wheels.torque / (4.0 * largest * _FARTHEST_LINEAR)),
        "the momentum of the wheels": 0.5 * DAMPING * _SHARE_OF_MOMENTUM * wheels.momentum / largest,
        "the low-pass on the rate": 2.0 * math.pi * corner_hz * _BELOW_CORNER,
    }
    limit = min(limits, key=lambda name: limits[name])
    bandwidth = limits[limit]
    while (margin := gain_margin_db(model, _gains(largest, bandwidth))) < LEAST_MARGIN_DB:
        limit, bandwidth = "the sampled loop's gain margin", 0.9 * bandwidth
        if bandwidth < _SLOWEST:
            raise DesignError(
                f"--period: {model.period:g} s given, with which no gains keep a margin of {LEAST_MARGIN_DB:g} dB, "
                "expected a shorter control cycle"
            )
    rounded = _rounded(_gains(largest, bandwidth))
    return Loop(rounded, bandwidth, limit, min(margin, gain_margin_db(model, rounded)), 4.0 / (DAMPING * bandwidth))


def _gains(moment: float, bandwidth: float) -> Gains:
    return Gains(4.0 * moment * bandwidth**2, 2.0 * DAMPING * moment * bandwidth, 0.0)


def _rounded(gains: Gains) -> Gains:
    """To three digits, as people read them."""
    return Gains(float(f"{gains.k:.3g}"), float(f"{gains.p:.3g}"), 0.0)
