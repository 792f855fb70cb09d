# SPDX-License-Identifier: Apache-2.0
"""What is wrong with what is analysed."""


class StudyError(Exception):
    """A study that cannot be made, resumed or read; the message says why in one line."""
