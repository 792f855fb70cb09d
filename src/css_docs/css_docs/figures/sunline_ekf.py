# SPDX-License-Identifier: Apache-2.0
"""The Kalman filter and the weighted average in one flight."""

from matplotlib.figure import Figure

from css_docs.figures._flights import fly, headings, with_nodes

CAPTION = """\
The same cells through the Kalman filter, which flies, and the weighted average beside it: `okeefe_2013`, case 7,
from the tumble on. Warp, degradation and the light of the Earth are on the cells; the filter's bound covers them by
`cell_sigma`."""


def figure() -> Figure:
    """Both errors, and the filter's own bound."""
    log = fly("okeefe_2013", with_nodes("wavg"), "mission.case=7", "mission.duration=600")
    return headings({"Kalman filter": (log, "ekf"), "weighted average": (log, "wavg")}, bounds=("Kalman filter",))
