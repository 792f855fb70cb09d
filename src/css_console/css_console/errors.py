# SPDX-License-Identifier: Apache-2.0
"""What can go wrong with the console itself."""


class ConsoleError(Exception):
    """The console cannot run; one line that says why, and what would help."""


class OrderError(Exception):
    """A message from a browser that means nothing; one line with what was given and what was expected."""
