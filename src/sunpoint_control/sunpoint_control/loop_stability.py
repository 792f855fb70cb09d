# SPDX-License-Identifier: Apache-2.0
"""Can the control loop be stable? The sampled, linearised loop of a mission, its modes, and the gains that it bears.

Near the Sun sigma_br is a quarter of the angle across the array normal c, and what the control asks of the wheels is

    u_k = -K/4 theta_k - P (f_k + K_I (q_k + I f_k)),      q_k+1 = q_k + h K/4 theta_k

with theta the two angles across c, f the rate that the estimator gives and h the control cycle. Wheels hold u_k until
the next command, and the body turns under it as

    omega_k+1 = omega_k + h I^-1 G u_k,    theta_k+1 = theta_k + h omega_k + h^2/2 I^-1 G u_k

where G projects on the directions that the wheels in service can turn. The estimator smooths the rate by a first-order
low-pass of gain g: f_k = f_k-1 + g (m_k - f_k-1), m_k = omega_k with a gyro. Without one the estimator's own heading
t_k = t_k-1 + h f_k-1 + L (theta_k - t_k-1 - h f_k-1), L being 1 without memory, stands for theta in the control, and
m_k is its mean rate since the last cycle, (t_k - t_k-1) / h. A command reaches the body in the cycle of the
measurement that it answers; with devices that have clocks of their own it may be one cycle late. A mode whose
eigenvalue lies outside the unit circle grows until the wheels' torque limit holds it. Damping of rates alone (first
mode of flight, shadow, search, deadband) is the same loop with K = 0.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from css_common.component import Finding, Smoothing

_STABLE = 1.0 + 1e-6  # modulus of an eigenvalue; modes at rest have 1, which rounding may split by 1e-8
_MARGIN = 2.0  # 6 dB, the gain margin usual in control engineering
_SEARCH_STEP = 10.0**0.05
_SEARCH_STEPS = 160  # eight decades
_BISECTIONS = 30
_LARGEST_GAIN = 1e6  # above it the search for the limit begins lower
_SMALLEST_GAIN = 1e-6
_SHOWN = 3  # digits


class LoopModel(NamedTuple):
    """What the loop consists of, but for the gains."""

    inertia: np.ndarray  # (3, 3) [kg m^2] of the body
    array_normal_b: np.ndarray  # (3,)
    authority: np.ndarray  # (3, 3) projection on the directions that the wheels can turn
    period: float  # [s]
    smoothing: Smoothing  # of the estimator
    gyro: bool
    late: bool  # commands arrive one cycle late


class Gains(NamedTuple):
    """Gains of the control."""

    k: float
    p: float
    ki: float


def fastest_growth(model: LoopModel, gains: Gains) -> float:
    """Largest modulus of the loop's eigenvalues: growth from cycle to cycle of its fastest mode."""
    with np.errstate(over="ignore", invalid="ignore"):
        cycle = transition(model, gains)
        if not np.isfinite(cycle).all():  # gains near the largest numbers there are
            return math.inf
        return float(np.max(np.abs(np.linalg.eigvals(cycle))))


def transition(model: LoopModel, gains: Gains) -> np.ndarray:
    """(15, 15) matrix of one cycle of theta (2), the last heading (2), omega (3), f (3), q (2) and the last u (3)."""
    across = _across(model.array_normal_b)  # (2, 3): theta = across . rotation vector
    h, g = model.period, model.smoothing.rate
    theta, before, omega, f, q, last = _selectors((2, 2, 3, 3, 2, 3))
    if model.gyro:
        heading, measured = theta, omega
    else:
        predicted = before + h * across @ f
        heading = predicted + model.smoothing.heading * (theta - predicted)
        measured = across.T @ (heading - before) / h
    rate = (1.0 - g) * f + g * measured
    integral = across.T @ q + model.inertia @ rate
    u = -(gains.k / 4.0 * across.T @ heading + gains.p * (rate + gains.ki * integral))
    turn = np.linalg.solve(model.inertia, model.authority @ (last if model.late else u))
    return np.vstack(
        [
            theta + across @ (h * omega + 0.5 * h * h * turn),
            heading,
            omega + h * turn,
            rate,
            q + h * gains.k / 4.0 * heading,
            u,
        ]
    )


def _selectors(sizes: tuple[int, ...]) -> list[np.ndarray]:
    """Rows of the identity that pick each part of a state."""
    return np.split(np.eye(sum(sizes)), np.cumsum(sizes)[:-1])


def _across(axis: np.ndarray) -> np.ndarray:
    """(2, 3) unit vectors across an axis."""
    return np.linalg.svd(axis.reshape(1, 3))[2][1:]


def gain_findings(model: LoopModel, gains: Gains, setting: str) -> Iterator[Finding]:
    """Gains that the loop cannot bear, and those that it bears with less than 6 dB to spare.

    Args:
        setting: words for what the limits hold with.
    """
    lively = _lively(model)
    damping = gains._replace(k=0.0, ki=0.0)
    for name, loop in (("rate damping", damping), ("the control loop", gains)):
        growth = fastest_growth(lively, loop)
        if growth > _STABLE:
            yield Finding(_unstable(lively, loop, name, growth, setting), refused=True)
            return
    stiffer = lively._replace(inertia=model.inertia / _MARGIN)
    inner = gains._replace(ki=gains.ki * _MARGIN)  # the same law on a body that answers twice as strongly
    stable = _is_stable(model, gains) and _is_stable(stiffer, inner) and _is_stable(stiffer, damping)
    if not stable:
        key, limits = _remedy(lively, gains)
        yield Finding(
            f"gains.{key}: {getattr(gains, key):g} given, expected a gain margin of at least 6 dB; the control loop is "
            f"stable with {limits} {setting}"
        )


def _lively(model: LoopModel) -> LoopModel:
    """The loop with an estimator that learns from more than one cell, if it is such a one.

    A filter without gyro lags by how many cells are lit; what is unstable with few is doubtful, with many refused.
    """
    if model.gyro:
        return model
    return model._replace(smoothing=model.smoothing._replace(heading=min(1.0, 2.0 * model.smoothing.heading)))


def _unstable(model: LoopModel, gains: Gains, name: str, growth: float, setting: str) -> str:
    key, limits = _remedy(model, gains)
    tenfold = model.period * math.log(10.0) / math.log(growth)
    return (
        f"gains.{key}: {getattr(gains, key):g} given, expected {limits} {setting}: {name} is unstable, its fastest "
        f"mode grows tenfold in {tenfold:.3g} s"
    )


def _remedy(model: LoopModel, gains: Gains) -> tuple[str, str]:
    """The gain whose smallest change makes the loop stable, or brings it to its limit, and that limit in words."""
    found = []
    for key in Gains._fields:
        given = getattr(gains, key)
        if given > 0.0 or key == "p":
            # a rate gain of zero is what is wrong, however far the right one is away
            found += [
                (abs(math.log(limit / given)) if given else 0.0, key, words)
                for limit, words in _limits(model, gains, key)
            ]
    if not found:
        return "p", "gains that fit together"
    _, key, words = min(found)
    return key, words


def _limits(model: LoopModel, gains: Gains, key: str) -> Iterator[tuple[float, str]]:
    """Where the loop changes between stable and unstable when one gain moves, down and up: the limit, and in words."""
    start = getattr(gains, key) or _SMALLEST_GAIN
    stable = _is_stable(model, gains)
    while start > _LARGEST_GAIN and _is_stable(model, gains._replace(**{key: math.sqrt(start)})) == stable:
        start = math.sqrt(start)
    for factor in (1.0 / _SEARCH_STEP, _SEARCH_STEP):
        inside = start
        for _ in range(_SEARCH_STEPS):
            outside = inside * factor
            if _is_stable(model, gains._replace(**{key: outside})) != stable:
                at_most = (factor < 1.0) != stable
                limit = _bisected(model, gains, key, (inside, outside) if stable else (outside, inside))
                yield limit, f"{'at most' if at_most else 'at least'} {_rounded(limit, down=at_most)}"
                break
            inside = outside


def _bisected(model: LoopModel, gains: Gains, key: str, bracket: tuple[float, float]) -> float:
    """The last stable value between a stable and an unstable one."""
    good, bad = bracket
    for _ in range(_BISECTIONS):
        middle = math.sqrt(good * bad)
        if _is_stable(model, gains._replace(**{key: middle})):
            good = middle
        else:
            bad = middle
    return good


def _is_stable(model: LoopModel, gains: Gains) -> bool:
    return fastest_growth(model, gains) <= _STABLE


def _rounded(value: float, down: bool) -> str:
    """Three digits that lie on the safe side."""
    step = 10.0 ** (math.floor(math.log10(value)) - _SHOWN + 1)
    return f"{(math.floor if down else math.ceil)(value / step) * step:.{_SHOWN}g}"
