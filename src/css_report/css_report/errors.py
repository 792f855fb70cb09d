# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a page."""


class ReportError(Exception):
    """A page that cannot be made; the message says why in one line."""
