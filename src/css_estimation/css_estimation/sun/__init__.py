# SPDX-License-Identifier: Apache-2.0
"""Sun headings: direction of the Sun and body rate from cells."""
