# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a study."""

from css_analysis.study_record import StudyError

__all__ = ["StudyError"]
