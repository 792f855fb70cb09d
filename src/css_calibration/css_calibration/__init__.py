# SPDX-License-Identifier: Apache-2.0
"""Batch calibration of sensors, and the health of cells over whole recordings."""
