# SPDX-License-Identifier: Apache-2.0
"""No paper: what a failed cell, wheel, rod, gyro or magnetometer does to each mission, and what is done about it."""
