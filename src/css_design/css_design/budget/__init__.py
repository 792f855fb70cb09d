# SPDX-License-Identifier: Apache-2.0
"""Heading and pointing error of a mission, split by what makes it."""
