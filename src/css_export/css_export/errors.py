# SPDX-License-Identifier: Apache-2.0
"""What can go wrong with an export."""


class ExportError(ValueError):
    """What was asked for cannot be exported; the text says what, where, and what would be right."""


class ToolError(RuntimeError):
    """A compiler or an emulator is missing or failed."""
