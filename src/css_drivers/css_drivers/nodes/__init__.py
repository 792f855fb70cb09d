# SPDX-License-Identifier: Apache-2.0
"""One executable a file: drivers, relays and the bridge to a board. What they know of chips and bytes is one level up."""
