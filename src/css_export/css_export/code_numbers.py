# SPDX-License-Identifier: Apache-2.0
"""Numbers as they stand in intermediate code, and sums with them."""

import re

from css_export.code_text import VALUE, Instruction
from css_export.range_arithmetic import ANY, Range

BINARY = re.compile(rf"^((?:[a-z]+ )*)i(\d+) ({VALUE}), ({VALUE})")
"""Flags, bits and both values of an operation on whole numbers."""


def added_number(made: Instruction) -> tuple[str, int, bool] | None:
    """Of a sum of a value and a number: the value, the number, and whether it never overflows."""
    found = BINARY.match(made.rest) if made.opcode in ("add", "sub", "or") else None
    if found is None or not re.fullmatch(r"-?\d+", found[4]):
        return None
    flags = found[1].split()
    if made.opcode == "or" and "disjoint" not in flags:
        return None
    number = -int(found[4]) if made.opcode == "sub" else int(found[4])
    return found[3], number, made.opcode == "or" or "nsw" in flags or "nuw" in flags


def literal(value: str) -> Range:
    """Of a number as it stands in the code; of anything else nothing is known."""
    if value in ("true", "false"):
        return Range(int(value == "true"), int(value == "true"))
    return Range(int(value), int(value)) if re.fullmatch(r"-?\d+", value) else ANY
