# SPDX-License-Identifier: Apache-2.0
"""Arithmetic of ranges of whole numbers, against all values of small ones."""

import pytest

from css_export.range_arithmetic import ANY, Range, binary, casted, intrinsic, joined, narrowed

SMALL = [Range(a, b) for a in range(-8, 8, 3) for b in range(a, 8, 3)]


@pytest.mark.parametrize("opcode", ["add", "sub", "mul", "and", "or", "xor"])
def test_ranges_hold_all_results(opcode):
    made = {
        "add": int.__add__,
        "sub": int.__sub__,
        "mul": int.__mul__,
        "and": int.__and__,
        "or": int.__or__,
        "xor": int.__xor__,
    }
    for one in SMALL:
        for other in SMALL:
            found = binary(opcode, (), 64, one, other)
            values = [made[opcode](a, b) for a in span(one) for b in span(other)]
            assert found.low is None or found.low <= min(values)
            assert found.high is None or found.high >= max(values)


@pytest.mark.parametrize("opcode", ["shl", "lshr", "ashr", "udiv", "urem", "srem"])
def test_ranges_of_shifts_and_divisions_hold_all_results(opcode):
    width = 8

    def natural(value):
        return value % (1 << width)

    made = {
        "shl": lambda a, b: a << b,
        "lshr": lambda a, b: natural(a) >> b,
        "ashr": lambda a, b: a >> b,
        "udiv": lambda a, b: natural(a) // b,
        "urem": lambda a, b: natural(a) % b,
        "srem": lambda a, b: abs(a) % b * (1 if a >= 0 else -1),
    }
    for one in SMALL:
        for by in (1, 2, 3):
            found = binary(opcode, (), width, one, Range(by, by))
            values = [made[opcode](a, by) for a in span(one)]
            assert found.low is None or found.low <= min(values)
            assert found.high is None or found.high >= max(values)


def span(given):
    """All values of a range."""
    return range(given.low, given.high + 1)


def test_what_may_overflow_is_not_known():
    assert binary("add", (), 8, Range(100, 120), Range(0, 10)) == ANY
    assert binary("add", ("nsw",), 8, Range(100, 120), Range(0, 10)) == Range(100, 130)
    assert binary("mul", (), 8, Range(0, 20), Range(0, 20)) == ANY


def test_casts():
    assert casted("zext", (), 1, 64, Range(0, 1)) == Range(0, 1)
    assert casted("zext", (), 8, 64, ANY) == Range(0, 255)
    assert casted("zext", (), 8, 64, Range(-1, 4)) == Range(0, 255)
    assert casted("sext", (), 1, 64, Range(0, 1)) == Range(-1, 0)
    assert casted("trunc", (), 64, 8, Range(0, 127)) == Range(0, 127)
    assert casted("trunc", (), 64, 8, Range(0, 128)) == ANY


def test_conditions_and_choices():
    assert narrowed(ANY, "slt", Range(3, 7)) == Range(None, 6)
    assert narrowed(ANY, "ult", Range(3, 7)) == Range(0, 6)
    assert narrowed(ANY, "ult", Range(-3, 7)) == ANY
    assert narrowed(Range(0, 5), "ne", Range(0, 0)) == Range(1, 5)
    assert narrowed(Range(0, 5), "eq", Range(2, 9)) == Range(2, 5)
    assert joined([Range(1, 2), Range(None, 1)]) == Range(None, 2)
    assert intrinsic("llvm.smin.i64", [ANY, Range(6, 6)]) == Range(None, 6)
    assert intrinsic("llvm.umin.i64", [ANY, Range(6, 6)]) == Range(0, 6)
    assert intrinsic("llvm.ctpop.i64", [ANY]) == Range(0, 64)
    assert intrinsic("exp", [ANY]) == ANY
