# SPDX-License-Identifier: Apache-2.0
"""The one exception for a recording that cannot be written, read or understood."""


class BagError(Exception):
    """A recording cannot be used as asked. The text names the file, what is wrong and what helps."""
