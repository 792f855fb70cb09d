# SPDX-License-Identifier: Apache-2.0
"""Hardware in the graph: cells on a converter, other people's sensors, and a board in the loop."""
