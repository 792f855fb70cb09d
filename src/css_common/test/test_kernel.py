# SPDX-License-Identifier: Apache-2.0
"""A kernel gives the same to Python and to kernels; constants that it is called with make no copies of it."""

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import typeof, types
from numba.core.codegen import JITCodeLibrary
from numba.core.errors import NumbaError

from css_common.kernel import kernel, outer_kernel, study_kernel


class Point(NamedTuple):
    """What a kernel is handed."""

    x: float
    y: float


@kernel
def weighted(p, weight, offset=1.0):
    return weight * p.x - p.y / offset


@kernel
def three_times(p):
    return weighted(p, 1), weighted(p, 2), weighted(p, 3, offset=7.0)


@study_kernel
def in_a_study(p):
    return three_times(p)


@outer_kernel
def in_an_outermost_loop(p):
    return three_times(p)


@kernel
def same_table(table):
    return table


@kernel
def first_of_table(table):
    return same_table(table)[0]


@pytest.mark.parametrize("caller", [three_times, in_a_study, in_an_outermost_loop])
def test_calls_from_kernels_give_what_calls_from_python_give(caller):
    p = Point(0.1, 0.7)
    assert caller(p) == (weighted(p, 1), weighted(p, 2), weighted(p, 3, offset=7.0))
    assert weighted(p, 3, offset=7.0) == weighted.py_func(p, 3, offset=7.0)


def test_constants_in_calls_make_no_copies_of_a_kernel():
    point = typeof(Point(1.0, 2.0))
    dispatcher: Any = weighted
    templates = [dispatcher.get_call_template((point, types.literal(weight)), {})[0] for weight in (1, 2, 3)]
    versions = [signature.args for signature in templates[-1].cases if signature.args[0] == point]
    assert {weight for _, weight, _ in versions} == {types.int64}
    assert len(templates[-1].cases) == len(templates[0].cases)


def test_a_kernel_that_returns_an_array_is_refused_whoever_calls_it():
    reason = "same_table: a kernel must not return an array"
    with pytest.raises(TypeError, match=reason):
        same_table(np.zeros(3))
    with pytest.raises((TypeError, NumbaError), match=reason):
        first_of_table(np.zeros(3))


@kernel
def refused_below_zero(x):
    if x < 0.0:
        raise ValueError("below zero")
    return math.sqrt(x)


@kernel
def root_of_root(x):
    return refused_below_zero(refused_below_zero(x) - 1.0)


def test_errors_of_what_is_linked_come_through():
    assert root_of_root(16.0) == root_of_root.py_func(16.0) == math.sqrt(3.0)
    for x in (-1.0, 0.25):
        with pytest.raises(ValueError, match="below zero"):
            root_of_root(x)


@kernel
def once_more(p):
    return three_times(p)


@study_kernel
def in_another_study(p):
    return once_more(p)


def test_machine_code_is_made_of_the_outermost_alone(monkeypatch):
    made = []
    finalize = JITCodeLibrary._finalize_specific

    def noted(library):
        made.append(library.name)
        return finalize(library)

    monkeypatch.setattr(JITCodeLibrary, "_finalize_specific", noted)
    in_another_study(Point(0.1, 0.7))
    assert ["in_another_study" in name for name in made] == [True]
