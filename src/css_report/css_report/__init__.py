# SPDX-License-Identifier: Apache-2.0
"""Pages of flights, studies and reproduced papers: one file each, which opens in a browser without a network."""
