# SPDX-License-Identifier: Apache-2.0
"""Attitude maths, random streams, compiled-kernel decorator, mission schema and the node base shared by every Sunpoint package."""
