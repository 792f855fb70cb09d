# SPDX-License-Identifier: Apache-2.0
"""Tables of telemetry as people have them, read by a description and turned into recordings."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from css_telemetry.importing import import_table

__all__ = ["import_table"]


def __getattr__(name: str) -> Any:
    # a second of loading that the help of commands need not wait for
    if name == "import_table":
        from css_telemetry import importing

        return importing.import_table
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
