# SPDX-License-Identifier: Apache-2.0
"""Bytes of states: what a compiled loop finds in the row of a case is what was left there."""

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba.core.errors import NumbaError

from css_common.kernel import study_kernel
from css_monte_carlo import state_table
from css_monte_carlo.state_table import StateTable, keep_state, state_of


class Inner(NamedTuple):
    """Numbers of several kinds."""

    counted: int
    known: bool
    seed: np.uint32
    share: np.float32


class State(NamedTuple):
    """As a flight's: nested, with parts that are missing and arrays."""

    vector: tuple[float, float, float]
    inner: Inner
    nothing: Any
    memory: np.ndarray


def state(c):
    inner = Inner(-(2**62) - c, c % 2 == 0, np.uint32(2**32 - 1 - c), np.float32(0.1 * c))
    return State((1.0 / 3.0 + c, -math.inf, 5e-324), inner, None, np.full(2, float(c)))


@study_kernel
def advance(rows, like, out):
    """Reads every state, notes what it is, and leaves another."""
    for c in range(rows.shape[0]):
        s = state_of(rows, c, like)
        i = s.inner
        out[c, 0], out[c, 1], out[c, 2] = s.vector
        out[c, 3], out[c, 4], out[c, 5], out[c, 6] = i.counted + 2**62, i.known, i.seed, i.share
        out[c, 7] = s.memory[0]
        s.memory[1] += 1.0
        after = Inner(i.counted + 1, not i.known, i.seed, i.share)
        keep_state(rows, c, like, State((s.vector[1], s.vector[2], s.vector[0]), after, s.nothing, s.memory))


@study_kernel
def leave_another_type(rows, like):
    keep_state(rows, 0, like, like.inner)


def test_every_case_has_its_own_state_from_call_to_call():
    states = [state(c) for c in range(5)]
    table = StateTable(states)
    first, second = np.zeros((5, 8)), np.zeros((5, 8))
    advance(table.rows, table.like, first)
    advance(table.rows, table.like, second)
    for c, s in enumerate(states):
        i = s.inner
        numbers = [-float(c), i.known, float(i.seed), float(i.share), float(c)]
        assert first[c].tolist() == [*s.vector, *numbers]
        numbers[0], numbers[1] = 1.0 - c, not i.known
        assert second[c].tolist() == [s.vector[1], s.vector[2], s.vector[0], *numbers]
        assert s.memory.tolist() == [c, c + 2.0], "arrays are those that were given"


def test_a_state_of_another_type_is_refused():
    table = StateTable([state(0)])
    with pytest.raises(NumbaError, match=r"has become .*Inner"):
        leave_another_type(table.rows, table.like)


def test_a_state_that_does_not_fit_is_refused(monkeypatch):
    monkeypatch.setattr(state_table, "_ROW_BYTES", 8)
    with pytest.raises(NumbaError, match="has more than 8 bytes"):
        StateTable([(1.0, 2, 3.0)])
