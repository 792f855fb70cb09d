# SPDX-License-Identifier: Apache-2.0
"""Monte Carlo of whole missions: the algorithms of the nodes in one compiled loop over cases and steps."""

from css_studies.monte_carlo.study import Configuration, Study, read_study, run_study
from css_studies.monte_carlo.study_folder import StudyError

__all__ = ["Configuration", "Study", "StudyError", "read_study", "run_study"]
