# SPDX-License-Identifier: Apache-2.0
"""Arithmetic of ranges of whole numbers, as LLVM's instructions have them."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple


class Range(NamedTuple):
    """Least and largest value, as signed numbers; None: not known. A condition is 0 or 1."""

    low: int | None
    high: int | None


ANY = Range(None, None)


def joined(ranges: Iterable[Range]) -> Range:
    """What holds for whichever of them."""
    found = list(ranges) or [ANY]
    lows, highs = [r.low for r in found], [r.high for r in found]
    low = None if None in lows else min(end for end in lows if end is not None)
    return Range(low, None if None in highs else max(end for end in highs if end is not None))


def _highest(one: int | None, other: int | None) -> int | None:
    return other if one is None else one if other is None else max(one, other)


def _lowest(one: int | None, other: int | None) -> int | None:
    return other if one is None else one if other is None else min(one, other)


def narrowed(given: Range, predicate: str, other: Range) -> Range:
    """A range of which it is known how its value compares with another one."""
    low, high = given
    below = None if other.high is None else other.high - (predicate in ("slt", "ult"))
    above = None if other.low is None else other.low + (predicate in ("sgt", "ugt"))
    if predicate == "eq":
        return Range(_highest(low, other.low), _lowest(high, other.high))
    if predicate == "ne" and other.low is not None and other.low == other.high:
        return Range(low + 1 if low == other.low else low, high - 1 if high == other.low else high)
    if predicate in ("slt", "sle"):
        return Range(low, _lowest(high, below))
    if predicate in ("sgt", "sge"):
        return Range(_highest(low, above), high)
    if predicate in ("ult", "ule") and other.low is not None and other.low >= 0:
        return Range(_highest(low, 0), _lowest(high, below))
    if predicate in ("ugt", "uge") and low is not None and low >= 0 and other.low is not None and other.low >= 0:
        return Range(_highest(low, above), high)
    return given


def _is_natural(given: Range) -> bool:
    return given.low is not None and given.low >= 0


def _held(found: Range, width: int, never_overflows: bool) -> Range:
    """What of a result is known, where it may overflow."""
    least, largest = -(1 << (width - 1)), (1 << (width - 1)) - 1
    if never_overflows:
        return found
    if found.low is None or found.high is None or found.low < least or found.high > largest:
        return ANY
    return found


def binary(opcode: str, flags: Sequence[str], width: int, one: Range, other: Range) -> Range:
    """Of an operation on two values of so many bits."""
    sure = "nsw" in flags
    if opcode == "add" or (opcode == "or" and "disjoint" in flags):
        ends = [None if a is None or b is None else a + b for a, b in zip(one, other, strict=True)]
        return _held(Range(*ends), width, sure or opcode == "or")
    if opcode == "sub":
        low = None if one.low is None or other.high is None else one.low - other.high
        high = None if one.high is None or other.low is None else one.high - other.low
        return _held(Range(low, high), width, sure)
    if opcode == "shl" and other.low is not None and other.low == other.high and 0 <= other.low < width:
        opcode, other = "mul", Range(1 << other.low, 1 << other.low)
    if opcode == "mul":
        return _product(one, other, width, sure)
    if opcode in ("and", "or", "xor"):
        return _bits(opcode, one, other)
    return _shifted_or_divided(opcode, width, one, other)


def _product(one: Range, other: Range, width: int, sure: bool) -> Range:
    if None in one or None in other:
        natural = sure and _is_natural(one) and _is_natural(other)
        return Range(0, None) if natural else ANY
    products = [a * b for a in one for b in other]  # type: ignore[operator]  # none is None
    return _held(Range(min(products), max(products)), width, sure)


def _bits(opcode: str, one: Range, other: Range) -> Range:
    if opcode == "and":
        if (rounded := _rounded(one, other) or _rounded(other, one)) is not None:
            return rounded
        highs = [r.high for r in (one, other) if _is_natural(r) and r.high is not None]
        natural = _is_natural(one) or _is_natural(other)
        return Range(0 if natural else None, min(highs, default=None))
    if _is_natural(one) and _is_natural(other):
        if one.high is None or other.high is None:
            return Range(0, None)
        return Range(0, (1 << max(one.high, other.high).bit_length()) - 1)
    return ANY


def _rounded(one: Range, mask: Range) -> Range | None:
    """A range of which a mask takes the last bits alone; None: it takes others, too."""
    if mask.low is None or mask.low != mask.high or not _is_natural(one) or one.low is None or one.high is None:
        return None
    taken = last_bits(mask.low)
    if one.high & ~taken & ~mask.low:
        return None
    return Range(one.low & ~taken, one.high & ~taken) if mask.low | taken >= one.high or mask.low < 0 else None


def last_bits(mask: int) -> int:
    """The bits below the last one of a mask that is set."""
    return (mask & -mask) - 1 if mask else 0


def _shifted_or_divided(opcode: str, width: int, one: Range, other: Range) -> Range:
    if other.low is None or other.low != other.high or other.low < 0:
        return Range(0, None if one.high is None else one.high) if opcode == "lshr" and _is_natural(one) else ANY
    by = other.low
    if opcode in ("urem", "srem") and by > 0:
        return Range(0 if opcode == "urem" or _is_natural(one) else 1 - by, by - 1)
    if opcode == "ashr" and by < width:
        return Range(*(None if end is None else end >> by for end in one))
    if opcode == "lshr" and 0 < by < width and not _is_natural(one):
        return Range(0, (1 << (width - by)) - 1)
    if opcode == "lshr" and by < width:
        return Range(*(None if end is None else end >> by for end in one))
    if opcode in ("udiv", "sdiv") and by > 0 and _is_natural(one):
        return Range(*(None if end is None else end // by for end in one))
    return ANY


def casted(opcode: str, flags: Sequence[str], narrow: int, wide: int, given: Range) -> Range:
    """Of a value of so many bits made one of others.

    Args:
        opcode: of the cast.
        flags: of it.
        narrow: bits before.
        wide: bits after.
        given: before.
    """
    if opcode == "trunc":
        return _held(given, wide, "nsw" in flags)
    if opcode == "sext":
        return Range(-1, 0) if narrow == 1 else given
    if "nneg" in flags:
        return Range(_highest(given.low, 0), given.high)
    return given if _is_natural(given) and given.high is not None else Range(0, (1 << narrow) - 1)


def intrinsic(name: str, arguments: Sequence[Range]) -> Range:
    """Of what a function of LLVM's own gives."""
    if not name.startswith("llvm."):
        return ANY
    kind, _, width = name.removeprefix("llvm.").partition(".i")
    if kind in ("ctpop", "cttz", "ctlz") and width.isdigit():
        return Range(0, int(width))
    if len(arguments) != 2:
        return ANY
    one, other = arguments
    if kind in ("smin", "smax") or (kind in ("umin", "umax") and _is_natural(one) and _is_natural(other)):
        if kind.endswith("min"):
            low = None if one.low is None or other.low is None else min(one.low, other.low)
            return Range(low, _lowest(one.high, other.high))
        high = None if one.high is None or other.high is None else max(one.high, other.high)
        return Range(_highest(one.low, other.low), high)
    if kind == "umin":
        # without sign the smaller is no more than the one of which that is known
        ends = [r.high for r in (one, other) if _is_natural(r) and r.high is not None]
        return Range(0, min(ends)) if ends else ANY
    return ANY
