# SPDX-License-Identifier: Apache-2.0
"""Simulated spacecraft dynamics, coarse sun sensors, gyro and magnetometer."""
