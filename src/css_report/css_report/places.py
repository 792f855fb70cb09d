# SPDX-License-Identifier: Apache-2.0
"""Where pages go."""

from pathlib import Path

STUDY_PAGE = "report.html"
"""The page of a study, in its folder."""


def page_of(subject: Path, against: Path | None = None) -> Path:
    """Where the page of a recording or a study goes: beside the recording, into the folder of the study.

    Args:
        subject: a rosbag2 folder, an `.mcap` file or the folder of a study.
        against: what stands beside it, which is part of the name.
    """
    subject = Path(subject)
    name = subject.stem if subject.is_file() else subject.absolute().name
    if against is None:
        if (subject / "study.json").is_file():
            return subject / STUDY_PAGE
        return subject.with_name(f"{name}.html") if subject.name else Path(f"{name}.html")
    other = Path(against)
    return subject.absolute().with_name(
        f"{name}_against_{other.stem if other.is_file() else other.absolute().name}.html"
    )
