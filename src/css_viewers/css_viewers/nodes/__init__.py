# SPDX-License-Identifier: Apache-2.0
"""One executable a file: drivers, relays and the bridge to a board. Chips and bytes are known one level up."""
