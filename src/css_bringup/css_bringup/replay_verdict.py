# SPDX-License-Identifier: Apache-2.0
"""Whether a replay did what was asked of it, and what is behind it if not."""

import json
from collections.abc import Mapping

from css_bringup.replayed import Replayed
from css_recording.provenance import STAND_INS, software_versions

ROUNDING = 1e-6
"""Largest difference of any value that other processors and library versions excuse."""

_DECIDES = ("cpu", "python", "numba", "numpy", "lock_sha256", "css_estimation")


def software_apart(recorded: Mapping[str, str]) -> str:
    """What differs between the software that flew and this one; empty when bytes must be equal.

    Args:
        recorded: what the recording says of its software; nothing: it is taken for another one.
    """
    here = software_versions()
    flown = [f"{node} of {made['file']}" for node, made in json.loads(recorded.get(STAND_INS, "{}")).items()]
    differing = [key for key in _DECIDES if recorded.get(key) != here.get(key)]
    if not any(key in recorded for key in _DECIDES):
        return "the recording does not say which software flew"
    other = [f"{key} {recorded.get(key, 'unknown')} flew, here {here.get(key, 'unknown')}" for key in differing]
    return ", ".join([*(f"{library} flew, here the function of the node" for library in flown), *other])


def shortcomings(run: Replayed, elsewhere: str) -> list[str]:
    """Why an estimator's replay is no success, one line each.

    Args:
        run: the estimator.
        elsewhere: result of `software_apart`.
    """
    lines = []
    if run.messages == 0:
        reasons = run.matcher.complaints() or ["none of its inputs came through the checks, or it was never active"]
        lines.append(f"no estimate from {run.label}: {'; '.join(reasons)}")
    comparison = run.comparison
    if comparison is None or comparison.identical:
        return lines
    if comparison.compared == 0 or comparison.unmatched or not is_rounding(run, elsewhere):
        why = f"; {elsewhere}" if elsewhere else ""
        lines.append(f"{run.label}: {comparison.text()}{why}")
    return lines


def is_rounding(run: Replayed, elsewhere: str) -> bool:
    """Whether what differs from the flight is no more than another processor or library explains."""
    comparison = run.comparison
    assert comparison is not None
    return not comparison.different or (bool(elsewhere) and comparison.largest_difference <= ROUNDING)
