# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a design."""


class DesignError(Exception):
    """What was asked for cannot be done; the message is one line for the user."""
