# SPDX-License-Identifier: Apache-2.0
"""What a component says itself of a cycle that failed."""


class ComponentError(Exception):
    """A cycle failed for a reason outside the component's own code; the text says which, and is reported alone."""
