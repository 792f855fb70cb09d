# SPDX-License-Identifier: Apache-2.0
"""Finishes a recording, and says what is in it."""

from pathlib import Path

from css_common.progress_lines import still_working
from css_recording.recovery import recover
from css_recording.salvage import RecoveryReport


def run(recording: Path, output: str | None) -> int:
    """Finishes the recording, in place or into a new folder; the exit code."""
    with still_working(f"recovering {recording}"):
        report = recover(recording, output)
    print(_summary(report))
    return 0


def _summary(report: RecoveryReport) -> str:
    total = sum(report.messages.values())
    state = "was complete" if report.was_complete else "recovered"
    lines = [f"{report.recording}: {state}, {total} messages"]
    lines += [f"  {count:9d}  {topic}" for topic, count in report.messages.items()]
    lines += [f"lost or in doubt: {loss}" for loss in report.losses]
    lines += [f"note: {note}" for note in report.notes]
    return "\n".join(lines)
