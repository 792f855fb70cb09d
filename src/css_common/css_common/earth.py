# SPDX-License-Identifier: Apache-2.0
"""The size of the Earth, which gives the altitude of a mission its meaning."""

EARTH_RADIUS = 6_378_137.0
"""Equatorial radius of the Earth [m], WGS 84 (NGA.STND.0036)."""
