# SPDX-License-Identifier: Apache-2.0
"""Distributions hold their moments and ends, and what is no distribution is said."""

import numpy as np
import pytest
from scipy import stats

from css_common.distributions import distribution

EVEN = (np.arange(4000) + 0.5) / 4000


def drawn(text, own=2.0):
    return np.array([distribution(text).draw(float(u), own) for u in EVEN])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("normal:0.05", stats.norm(2.0, 0.1)),
        ("normal:-1:0.5", stats.norm(-1.0, 0.5)),
        ("normal:1:0.5:0.2:1.1", stats.truncnorm((0.2 - 1.0) / 0.5, (1.1 - 1.0) / 0.5, 1.0, 0.5)),
        ("lognormal:0.3", stats.lognorm(0.3, scale=2.0)),
        ("uniform:0.1", stats.uniform(1.8, 0.4)),
        ("uniform:-3:1", stats.uniform(-3.0, 4.0)),
    ],
)
def test_even_numbers_give_the_quantiles(text, expected):
    np.testing.assert_allclose(drawn(text), expected.ppf(EVEN), rtol=1e-9, atol=1e-12)


def test_a_choice_gives_each_as_often():
    words, counts = np.unique(drawn("choice:mean:common:per_cell:x"), return_counts=True)
    assert words.tolist() == ["common", "mean", "per_cell", "x"] and counts.tolist() == [1000] * 4


@pytest.mark.parametrize(
    "text",
    ["", "normal", "normal:a", "normal:0", "normal:-1", "uniform:2:1", "uniform:1:1", "gauss:1", "normal:1:2:3",
     "choice:a", "choice:a:", "normal:nan", "uniform:0:inf", "normal:0:1:5:4", "lognormal:0.1:2", "normal:yes"],
)  # fmt: skip
def test_what_is_none_is_refused(text):
    with pytest.raises(ValueError, match=r"normal:S|a spread above 0|two values|second number|ends between"):
        distribution(text)
