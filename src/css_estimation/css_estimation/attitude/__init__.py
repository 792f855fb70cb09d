# SPDX-License-Identifier: Apache-2.0
"""Attitudes: filters and solutions that need the Sun and the magnetic field."""
