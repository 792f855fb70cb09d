# SPDX-License-Identifier: Apache-2.0
"""Sun-heading and attitude estimators on coarse sun sensor outputs."""
