# SPDX-License-Identifier: Apache-2.0
"""Finishes the recording of a recorder that was killed. `recover --help` tells how it is used."""

import argparse
import sys
from collections.abc import Sequence

from css_recording.errors import BagError
from css_recording.recovery import recover
from css_recording.salvage import RecoveryReport

_DESCRIPTION = """\
Finish a recording whose recorder was killed: keep every intact chunk, index it, and write the metadata that
the recorder had no time for. A folder whose metadata.yaml is lost or wrong gets a new one. A complete recording is
left as it is; one that is damaged elsewhere than at its end is refused unless an output is named."""

_EXIT = "Exit code: 0 the recording is complete (now), 1 it cannot be recovered, 2 wrong usage."


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = argparse.ArgumentParser("recover", description=_DESCRIPTION, epilog=_EXIT)
    parser.add_argument("recording", help="folder of the recording, or its .mcap file")
    parser.add_argument(
        "-o", "--output", help="write the finished recording to this new folder; leave the torn one untouched"
    )
    options = parser.parse_args(arguments)
    try:
        report = recover(options.recording, options.output)
    except BagError as error:
        print(f"recover: {error}", file=sys.stderr)
        return 1
    print(_summary(report))
    return 0


def _summary(report: RecoveryReport) -> str:
    total = sum(report.messages.values())
    state = "was complete" if report.was_complete else "recovered"
    lines = [f"{report.recording}: {state}, {total} messages"]
    lines += [f"  {count:9d}  {topic}" for topic, count in report.messages.items()]
    lines += [f"lost: {loss}" for loss in report.losses]
    lines += [f"note: {note}" for note in report.notes]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
