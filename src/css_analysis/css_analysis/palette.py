# SPDX-License-Identifier: Apache-2.0
"""Colours of figures and pages that colour-blind readers can tell apart."""

# Okabe & Ito, "Color Universal Design", 2008; yellow is left out, it is too pale for a line.
BLUE, ORANGE, GREEN, VERMILION = "#0072B2", "#E69F00", "#009E73", "#D55E00"
PURPLE, SKY, BLACK, GREY = "#CC79A7", "#56B4E9", "#000000", "#8C8C8C"
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK, GREY)
SHADE, DARK_GREY = "#E3E6EA", "#5A5A5A"
