# SPDX-License-Identifier: Apache-2.0
"""What flies: the four configurations of O'Keefe & Schaub 2013 as in print, and improved."""

from typing import NamedTuple

from css_analysis.figure_style import BLUE, GREEN, ORANGE, PURPLE, VERMILION
from css_monte_carlo.study import Configuration

MISSION = "okeefe_2013"


class Entry(NamedTuple):
    """A configuration as figures and tables name it."""

    label: str
    colour: str
    configuration: Configuration


AVERAGE, FILTER = "average", "filter"
"""The two methods of the paper, in labels."""
_KINDS = (
    (AVERAGE, True, ORANGE),
    (AVERAGE, False, VERMILION),
    (FILTER, True, BLUE),
    (FILTER, False, GREEN),
)


def _label(name: str, gyro: bool) -> str:
    return f"{name}, {'gyro' if gyro else 'no gyro'}"


AS_PRINTED = tuple(
    Entry(_label(kind, gyro), colour, Configuration({AVERAGE: "wavg", FILTER: "ekf"}[kind], gyro))
    for kind, gyro, colour in _KINDS
)
"""Weighted average and extended Kalman filter with the paper's gains and deadband."""

_CONTROL = (
    "mrp_control.deadband_behaviour=damp",
    "mrp_control.deadband_deg=4",
    "mrp_control.gains.k=0.3",
    "mrp_control.gains.p=1.5",
)


def _improved(estimator: str, gyro: bool) -> Configuration:
    forget = () if gyro else (f"{estimator}.rate.without_information=zero",)
    return Configuration(estimator, gyro, (*_CONTROL, *forget))


IMPROVED = tuple(
    Entry(_label(kind, gyro), colour, _improved({AVERAGE: "wls", FILTER: "ekf"}[kind], gyro))
    for kind, gyro, colour in _KINDS
)
"""What flies in their places to be better: least squares for the average, and for both a stiffer control, which damps
rates on the Sun too and, without gyro, does not hold in the dark the rate that the fading light gave."""

SWEPT = tuple(
    Entry(_label(name, gyro), colour, Configuration(estimator, gyro))
    for estimator, name, colour in (
        ("wavg", AVERAGE, ORANGE),
        ("wls", "least squares", PURPLE),
        ("ekf", FILTER, BLUE),
    )
    for gyro in (True, False)
)
"""Every estimator under the paper's control."""
