# SPDX-License-Identifier: Apache-2.0
"""A cell that sticks, with the layer that finds it and without."""

from matplotlib.figure import Figure

from css_docs.figures._flights import fly, headings

CAPTION = """\
Cell 5 sticks at 0.8 from 150 s on: heading of the Kalman filter behind the health of the cells, and without it,
where the flight follows the cell; `okeefe_2013`, case 7. Held for failed the cell counts as missing."""


def figure() -> Figure:
    """Two flights."""
    common = ("mission.case=7", "mission.duration=400", "css_array.faults=['cell.5 stuck 0.8 from 150']")
    watched = fly("okeefe_2013", *common)
    blind = fly("okeefe_2013", *common, "ekf.health.enabled=false")
    return headings({"health on": (watched, "ekf"), "health off": (blind, "ekf")})
