# SPDX-License-Identifier: Apache-2.0
"""Distributions that a parameter of a mission is drawn from, as people write them.

    normal:S               relative: the mission's value times 1 + S z, z a standard normal number
    normal:MEAN:S          of that mean and 1 sigma
    normal:MEAN:S:LOW:HIGH the same, cut off at both ends
    lognormal:S            the mission's value times exp(S z)
    uniform:R              relative: the mission's value times 1 - R to 1 + R
    uniform:LOW:HIGH       between two numbers
    choice:A:B:...         one of some words or numbers, each as likely

Numbers are in the unit of the parameter. A draw is made of one number between 0 and 1 by the inverse of the cumulative
distribution, so that evenly spread numbers give evenly spread draws.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from css_common.normal_distribution import normal_quantile
from css_common.parameter_words import word
from css_common.schema import shown

FORMS = (
    "normal:S, normal:MEAN:S, normal:MEAN:S:LOW:HIGH, lognormal:S, uniform:R, uniform:LOW:HIGH or choice:A:B:... "
    "(one number alone is relative to the mission's value)"
)

Draw = Callable[[float, Any], Any]
"""From a number above 0 and below 1 and the mission's own value to the value of a case."""


class Distribution(NamedTuple):
    """One distribution.

    Attributes:
        text: as it was written.
        relative: it is around the mission's own value, which then must not be zero.
        words: what a choice chooses from, as a file would have them; empty: it gives numbers.
        draw: makes a value.
    """

    text: str
    relative: bool
    words: tuple[str, ...]
    draw: Draw


def distribution(text: str) -> Distribution:
    """The distribution that a text stands for.

    Raises:
        ValueError: it stands for none; says what was expected.
    """
    kind, *given = (part.strip() for part in text.split(":"))
    if kind == "choice":
        return _choice(text, given)
    numbers = [_number(part) for part in given]
    if any(number is None for number in numbers):
        raise ValueError(FORMS)
    made = _DISTRIBUTIONS.get((kind, len(numbers)))
    if made is None:
        raise ValueError(FORMS)
    return made(text, *numbers)


def _number(text: str) -> float | None:
    value = word(text)
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    return float(value) if is_number else None


def _choice(text: str, words: list[str]) -> Distribution:
    if len(words) < 2 or not all(words):
        raise ValueError("choice:A:B:... with two values at least")
    return Distribution(text, False, tuple(words), lambda u, _: words[min(int(u * len(words)), len(words) - 1)])


def _positive(spread: float, what: str = "a spread above 0") -> None:
    if not spread > 0.0:
        raise ValueError(f"{what}, not {shown(spread)}")


def _normal_relative(text: str, sigma: float) -> Distribution:
    _positive(sigma)
    return Distribution(text, True, (), lambda u, own: own * (1.0 + sigma * normal_quantile(u)))


def _normal(text: str, mean: float, sigma: float) -> Distribution:
    _positive(sigma)
    return Distribution(text, False, (), lambda u, _: mean + sigma * normal_quantile(u))


def _normal_between(text: str, mean: float, sigma: float, low: float, high: float) -> Distribution:
    _positive(sigma)
    below, up_to = (0.5 * math.erfc((mean - end) / (sigma * math.sqrt(2.0))) for end in (low, high))
    if not (low < high and up_to - below > 1e-9):
        raise ValueError(f"ends between which the numbers of the distribution lie, not {low:g} and {high:g}")

    def draw(u: float, _: Any) -> float:
        # rounding must not bring a draw beyond an end
        return min(max(mean + sigma * normal_quantile(below + u * (up_to - below)), low), high)

    return Distribution(text, False, (), draw)


def _lognormal(text: str, sigma: float) -> Distribution:
    _positive(sigma)
    return Distribution(text, True, (), lambda u, own: own * math.exp(sigma * normal_quantile(u)))


def _uniform_relative(text: str, half: float) -> Distribution:
    _positive(half)
    return Distribution(text, True, (), lambda u, own: own * (1.0 + half * (2.0 * u - 1.0)))


def _uniform(text: str, low: float, high: float) -> Distribution:
    _positive(high - low, f"a second number above the first, {low:g}")
    return Distribution(text, False, (), lambda u, _: low + u * (high - low))


_DISTRIBUTIONS: dict[tuple[str, int], Callable[..., Distribution]] = {
    ("normal", 1): _normal_relative,
    ("normal", 2): _normal,
    ("normal", 4): _normal_between,
    ("lognormal", 1): _lognormal,
    ("uniform", 1): _uniform_relative,
    ("uniform", 2): _uniform,
}
