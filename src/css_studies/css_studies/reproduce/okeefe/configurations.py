# SPDX-License-Identifier: Apache-2.0
"""What flies: the four configurations of O'Keefe & Schaub 2013 as in print, and improved."""

from typing import NamedTuple

from css_studies.figure_style import BLUE, GREEN, ORANGE, PURPLE, VERMILION
from css_studies.monte_carlo import Configuration

MISSION = "okeefe_2013"


class Entry(NamedTuple):
    """A configuration as figures and tables name it."""

    label: str
    colour: str
    configuration: Configuration


_AVERAGE, _FILTER = "average", "filter"
_KINDS = (
    (_AVERAGE, True, ORANGE),
    (_AVERAGE, False, VERMILION),
    (_FILTER, True, BLUE),
    (_FILTER, False, GREEN),
)


def _label(name: str, gyro: bool) -> str:
    return f"{name}, {'gyro' if gyro else 'no gyro'}"


AS_PRINTED = tuple(
    Entry(_label(kind, gyro), colour, Configuration({_AVERAGE: "wavg", _FILTER: "ekf"}[kind], gyro))
    for kind, gyro, colour in _KINDS
)
"""Weighted average and extended Kalman filter with the paper's gains and deadband."""

_CONTROL = ("mrp_control.deadband_behaviour=damp",)

IMPROVED = tuple(
    Entry(_label(kind, gyro), colour, Configuration({_AVERAGE: "wls", _FILTER: "ekf"}[kind], gyro, _CONTROL))
    for kind, gyro, colour in _KINDS
)
"""What flies in their places when it shall be better: weighted least squares for the average."""

SWEPT = tuple(
    Entry(_label(name, gyro), colour, Configuration(estimator, gyro))
    for estimator, name, colour in (
        ("wavg", _AVERAGE, ORANGE),
        ("wls", "least squares", PURPLE),
        ("ekf", _FILTER, BLUE),
    )
    for gyro in (True, False)
)
"""Every estimator under the paper's control."""
