# SPDX-License-Identifier: Apache-2.0
"""Figures and numbers of Reichard et al., the Sun sensor of the ESPRIT rocket."""
