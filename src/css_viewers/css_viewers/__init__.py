# SPDX-License-Identifier: Apache-2.0
"""Flights for the viewers that people have: RViz, Foxglove, Lichtblick, PlotJuggler, Rerun."""
