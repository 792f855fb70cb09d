# SPDX-License-Identifier: Apache-2.0
"""What is wrong with the documentation."""


class DocsError(Exception):
    """The site cannot be built as asked; the message is one line for the user."""


class BrokenPages(DocsError):
    """Pages are wrong; what is wrong has been printed."""
