# SPDX-License-Identifier: Apache-2.0
"""Studies on the flight algorithms: coverage maps, single-process flights, figures and tables."""
