# SPDX-License-Identifier: Apache-2.0
"""The page of a study, or of two beside each other."""

from css_analysis.study_record import StudyRecord
from css_report.blocks import Page


def study_page(study: StudyRecord, against: StudyRecord | None = None) -> Page:
    """To come."""
    return Page("study", "", [])
