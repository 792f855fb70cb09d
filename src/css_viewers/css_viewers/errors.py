# SPDX-License-Identifier: Apache-2.0
"""What this package refuses."""


class ViewerError(Exception):
    """Something that cannot be shown; its text says what, where, and what would be right."""
