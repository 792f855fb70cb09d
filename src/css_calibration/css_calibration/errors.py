# SPDX-License-Identifier: Apache-2.0
"""What can be wrong with a recording that shall calibrate or be checked."""


class CalibrationError(Exception):
    """A recording that does not hold what a calibration or a check needs: one line with what would be right."""
