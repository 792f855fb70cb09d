# SPDX-License-Identifier: Apache-2.0
"""Figures of a flight or a replay, beside its recording. Apart from the options: matplotlib takes a second to load."""

from pathlib import Path

from css_analysis.flight_figures import write_figures
from css_analysis.flight_log import FlightLog
from css_bringup.options import FiguresError, console


def print_figures(log: FlightLog, folder: Path) -> None:
    """Writes the figures of a log and names their files.

    Raises:
        FiguresError: they cannot be written.
    """
    try:
        files = write_figures(log, folder)
    except OSError as error:
        raise FiguresError(f"{folder}: figures cannot be written: {error.strerror}") from error
    for file in files:
        console.print(f"figure: {file}", soft_wrap=True)
