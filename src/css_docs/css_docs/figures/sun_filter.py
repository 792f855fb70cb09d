# SPDX-License-Identifier: Apache-2.0
"""The Sun filter under clouds that it does not know."""

from matplotlib.figure import Figure

from css_docs.figures._flights import fly, headings

CAPTION = """\
The Sun filter under clouds that it does not know and an Earth half as bright again as the one that it expects, with
gyro and by the speeds of the wheels alone; `okeefe_sun_filter`, case 3. The steps down are its stages: Sun found,
turn about the Sun line found."""


def figure() -> Figure:
    """Two flights and their own bounds."""
    common = ("mission.case=3", "mission.duration=1200")
    gyro = fly("okeefe_sun_filter", *common)
    none = fly("okeefe_sun_filter", *common, "sun_filter.use_gyro=false")
    shown = {"gyro": (gyro, "sun_filter"), "no gyro": (none, "sun_filter")}
    return headings(shown, bounds=tuple(shown))
