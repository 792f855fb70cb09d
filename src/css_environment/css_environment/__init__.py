# SPDX-License-Identifier: Apache-2.0
"""Orbit, Sun, Earth rotation, eclipse, magnetic field and albedo, for simulated truth and flight software."""
