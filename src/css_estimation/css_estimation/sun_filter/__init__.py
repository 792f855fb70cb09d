# SPDX-License-Identifier: Apache-2.0
"""The Sun filter: attitude, rate, intensity and Earth as one state, of any layout of cells."""
