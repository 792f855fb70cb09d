# SPDX-License-Identifier: Apache-2.0
"""Spinning payloads: slit pulses, their Sun angles, coning."""
