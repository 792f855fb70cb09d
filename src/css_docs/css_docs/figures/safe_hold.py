# SPDX-License-Identifier: Apache-2.0
"""Flat cells and the pyramid in one flight."""

from matplotlib.figure import Figure

from css_docs.figures._flights import fly, headings, with_nodes

CAPTION = """\
`clark_1996_pyramid`: error of the sensed Sun by flat cells and pyramid, which fly, and by the flat cells of the
same spacecraft beside them. Once the panels face the Sun the pyramid is taken, which the light of the Earth does
not reach."""


def figure() -> Figure:
    """Both errors over half an hour."""
    nodes = with_nodes("flat", of="clark_1996_pyramid")
    log = fly("clark_1996_pyramid", nodes, "mission.duration=1800")
    return headings({"flat cells and pyramid": (log, "pyramid_switch"), "flat cells alone": (log, "flat")})
