# SPDX-License-Identifier: Apache-2.0
"""What every Sunpoint package builds on: attitude maths, random streams, missions, components and their host."""
