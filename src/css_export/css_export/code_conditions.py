# SPDX-License-Identifier: Apache-2.0
"""Which comparisons of whole numbers hold when a block of intermediate code is reached."""

import re
from collections.abc import Mapping
from typing import NamedTuple

from css_export.code_loops import Flow
from css_export.code_text import NAME, VALUE, Instruction, plain

_BRANCH = re.compile(rf"^i1 ({VALUE}), label %({NAME}), label %({NAME})")
_COMPARED = re.compile(rf"^(?:samesign )?([a-z]+) i\d+ ({VALUE}), ({VALUE})")
_BOTH = re.compile(rf"^(?:[a-z]+ )*i1 ({VALUE}), ({VALUE})")
_CHOSEN = re.compile(rf"^i1 ({VALUE}), i1 ({VALUE}), i1 ({VALUE})")
_INVERSE = {"slt": "sge", "sgt": "sle", "ult": "uge", "ugt": "ule", "eq": "ne"}
_INVERSE |= {inverse: predicate for predicate, inverse in _INVERSE.items()}
_SWAPPED = {"slt": "sgt", "sle": "sge", "ult": "ugt", "ule": "uge", "eq": "eq", "ne": "ne"}
_SWAPPED |= {other: predicate for predicate, other in _SWAPPED.items()}


class Condition(NamedTuple):
    """A comparison of whole numbers that holds: `one` PREDICATE `other`, as LLVM names it."""

    predicate: str
    one: str
    other: str


def swapped(condition: Condition) -> Condition:
    """The same, said of the other one."""
    return Condition(_SWAPPED[condition.predicate], condition.other, condition.one)


class Conditions:
    """Of one function."""

    def __init__(self, flow: Flow, made: Mapping[str, Instruction]) -> None:
        """Takes a function.

        Args:
            flow: of it.
            made: what makes each value.
        """
        self._flow, self._made = flow, made
        self._at: dict[str, list[Condition]] = {}

    def at(self, block: str) -> list[Condition]:
        """What holds whenever a block is reached: what led to those that every way passes."""
        if block not in self._at:
            above = self._flow.above.get(block)
            if above is None:
                self._at[block] = []
            else:
                before = self._flow.predecessors[block]
                own = self.on_edge(before[0], block) if len(before) == 1 else []
                self._at[block] = self.at(above) + own
        return self._at[block]

    def on_edge(self, before: str, block: str) -> list[Condition]:
        """What holds when one block leads to another."""
        last = self._flow.code.blocks[before].instructions[-1]
        found = _BRANCH.match(last.rest) if last.opcode == "br" else None
        if found is None or plain(found[2]) == plain(found[3]):
            return []
        return self.holding(found[1], plain(found[2]) == block)

    def holding(self, value: str, truth: bool) -> list[Condition]:
        """What holds when a condition is true, or when it is not."""
        made = self._made.get(value)
        whether = Condition("eq", value, "true" if truth else "false")
        if made is None:
            return [whether]
        if made.opcode == "icmp" and (found := _COMPARED.match(made.rest)):
            predicate = found[1] if truth else _INVERSE[found[1]]
            return [Condition(predicate, found[2], found[3])]
        if made.opcode == "freeze":
            return self.holding(made.rest.split()[-1], truth)
        if made.opcode == "xor" and (found := _BOTH.match(made.rest)) and found[2] == "true":
            return self.holding(found[1], not truth)
        if made.opcode == ("and" if truth else "or") and (found := _BOTH.match(made.rest)):
            return self.holding(found[1], truth) + self.holding(found[2], truth)
        if made.opcode == "select" and (found := _CHOSEN.match(made.rest)):
            if truth and found[3] == "false":
                return self.holding(found[1], True) + self.holding(found[2], True)
            if not truth and found[2] == "true":
                return self.holding(found[1], False) + self.holding(found[3], False)
        return [whether]
