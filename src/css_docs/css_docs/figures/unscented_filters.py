# SPDX-License-Identifier: Apache-2.0
"""Filters without gyro in one flight."""

from matplotlib.figure import Figure

from css_docs.figures._flights import fly, headings, with_nodes

CAPTION = """\
Without gyro: the two unscented filters, whose rate is a state, beside the Kalman filter, which flies with the rate
of successive Sun vectors; `okeefe_2013`, case 7."""


def figure() -> Figure:
    """Three errors."""
    off = [f"{name}.use_gyro=false" for name in ("ekf", "sunline_ukf", "sunline_suekf")]
    log = fly("okeefe_2013", with_nodes("sunline_ukf", "sunline_suekf"), *off, "mission.case=7", "mission.duration=400")
    names = ("ekf", "sunline_ukf", "sunline_suekf")
    return headings({name: (log, name) for name in names})
