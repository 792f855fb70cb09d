# SPDX-License-Identifier: Apache-2.0
"""DiGregorio & Crassidis, the Sun as a least-squares vector or as voltages in an attitude filter."""
