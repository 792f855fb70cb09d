# SPDX-License-Identifier: Apache-2.0
"""Figures that these tests write are looked at."""

from figure_checks import checked_figures

__all__ = ["checked_figures"]
