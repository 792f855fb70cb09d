# SPDX-License-Identifier: Apache-2.0
"""Within what the whole numbers of a function lie, and how often a loop of it goes round at most.

Only what the code itself says is taken: constants, lengths of arrays (which are constants here), the conditions that
hold on the way to a block, limits of parameters, and the word of the compiler that a sum does not overflow.
"""

import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from css_export.code_conditions import Condition, Conditions, swapped
from css_export.code_loops import Flow, Loop
from css_export.code_numbers import BINARY, added_number, literal
from css_export.code_text import NAME, VALUE, Instruction, callee, is_call, parts, plain
from css_export.range_arithmetic import ANY, Range, binary, casted, intrinsic, joined, last_bits, narrowed

_MOST = 10**9  # rounds beyond which a bound is none
_CAST = re.compile(rf"^((?:[a-z]+ )*)i(\d+) ({VALUE}) to i(\d+)")
_CHOSEN = re.compile(rf"^i1 ({VALUE}), i\d+ ({VALUE}), i\d+ ({VALUE})")
_INCOMING = re.compile(rf"^\[ (.*), %({NAME}) \]$")
_LOADED = re.compile(rf"^i(\d+), ptr (%{NAME})")
_WORD = re.compile(r"^i(\d+) ")
_PLACE = re.compile(rf"^(?:[a-z]+ )*i8, ptr (%{NAME}), i64 (\d+)")
_CASTS = ("zext", "sext", "trunc")
_SUMS = ("add", "sub", "mul", "shl", "and", "or", "xor", "lshr", "ashr", "udiv", "sdiv", "urem", "srem")


class _Steps(NamedTuple):
    """A value that changes by the same number from round to round of a loop."""

    start: str
    offset: int  # added to what it starts with
    step: int
    is_sure: bool  # the compiler knows that it does not overflow
    width: int  # [bits]
    before: str  # block from which the loop is entered


class Ranges:
    """Of one function, for given ranges of its arguments."""

    def __init__(self, flow: Flow, arguments: Mapping[str, Range], pointer: str, numbers: Mapping[int, Range]) -> None:
        """Takes what is known beforehand.

        Args:
            flow: of the function.
            arguments: ranges of those of which something is known.
            pointer: argument that points to the parameters; "": none does.
            numbers: ranges of the whole numbers of the parameters, by their places.
        """
        self._flow, self._arguments, self.pointer, self._numbers = flow, arguments, pointer, numbers
        self._where: dict[str, tuple[str, Instruction]] = {
            i.result: (name, i) for name in flow.order for i in flow.code.blocks[name].instructions if i.result
        }
        self._conditions = Conditions(flow, {name: i for name, (_, i) in self._where.items()})
        self._known: dict[tuple[str, str], Range] = {}
        self._rounds: dict[str, int | None] = {}
        self._counted: set[str] = set()
        self._asked: set[tuple[str, str]] = set()
        self._passing: dict[tuple[str, str], Range] = {}
        self._cuts = 0  # how often what was asked for hung on itself

    # Ranges

    def of(self, value: str, block: str) -> Range:
        """Within what a value lies whenever a block is passed."""
        if not value.startswith("%"):
            return literal(value)
        key = (value, block)
        known = self._known.get(key) or self._passing.get(key)
        if known is not None:
            return known
        if key in self._asked:
            self._cuts += 1
            return ANY
        self._asked.add(key)
        cuts = self._cuts
        found = self._arguments.get(value, ANY)
        if value in self._where:
            found = self._made(value, block)
        found = self._under(found, value, self._conditions.at(block), block)
        self._asked.discard(key)
        # what hung on itself may be known better when it is asked for alone
        (self._known if cuts == self._cuts or not self._asked else self._passing)[key] = found
        if not self._asked:
            self._passing.clear()
        return found

    def _under(self, given: Range, value: str, conditions: Iterable[Condition], block: str) -> Range:
        """A range under conditions on its value."""
        for condition in conditions:
            if condition.other == value:
                condition = swapped(condition)
            if condition.one == value:
                given = narrowed(given, condition.predicate, self.of(condition.other, block))
        return given

    def _made(self, value: str, block: str) -> Range:
        where, made = self._where[value]
        if made.opcode == "phi":
            return self._merged(value, where, made)
        if made.opcode == "freeze" and _WORD.match(made.rest):
            return self.of(made.rest.split()[-1], block)
        if made.opcode in ("icmp", "fcmp"):
            return Range(0, 1)
        if made.opcode in _SUMS and (found := BINARY.match(made.rest)):
            one, other = (self.of(found[k], block) for k in (3, 4))
            return binary(made.opcode, found[1].split(), int(found[2]), one, other)
        if made.opcode in _CASTS and (found := _CAST.match(made.rest)):
            return casted(made.opcode, found[1].split(), int(found[2]), int(found[4]), self.of(found[3], block))
        if made.opcode == "select" and (found := _CHOSEN.match(made.rest)):
            return joined(
                self._under(self.of(found[k], block), found[k], self._conditions.holding(found[1], truth), block)
                for k, truth in ((2, True), (3, False))
            )
        if is_call(made) and (called := callee(made)):
            return intrinsic(called[0], [self.of(argument, block) for argument in called[1]])
        if made.opcode == "load" and (found := _LOADED.match(made.rest)):
            return self._loaded(found[2])
        return ANY

    def _loaded(self, pointer: str) -> Range:
        place = self._where.get(pointer)
        found = _PLACE.match(place[1].rest) if place and place[1].opcode == "getelementptr" else None
        base, at = (found[1], int(found[2])) if found else (pointer, 0)
        return self._numbers.get(at, ANY) if base == self.pointer else ANY

    def _incoming(self, made: Instruction) -> list[tuple[str, str]]:
        """Values that come together, each with the block from which it comes."""
        _, _, rest = made.rest.partition(" ")
        found = [_INCOMING.match(part) for part in parts(rest)]
        blocks = self._flow.code.blocks
        return [(f[1], plain(f[2]) if plain(f[2]) in blocks else "") for f in found if f]

    def _merged(self, value: str, where: str, made: Instruction) -> Range:
        if not _WORD.match(made.rest):
            return ANY
        loop = next((known for known in self._flow.loops.values() if where in known.headers), None)
        steps = self._steps(value, loop) if loop else None
        if loop and steps:
            return self._over_rounds(loop, steps)
        grown = self._grown(value, loop, made) if loop else None
        if grown is not None:
            return grown
        return joined(
            self._under(self.of(one, before), one, self._conditions.on_edge(before, where), before)
            for one, before in self._incoming(made)
            if before in self._flow.predecessors
        )

    def _over_rounds(self, loop: Loop, steps: _Steps) -> Range:
        start, rounds = self.of(steps.start, steps.before), self.rounds(loop)
        if rounds is None and not steps.is_sure:
            return ANY
        way = None if rounds is None else steps.step * rounds
        if steps.step >= 0:
            return Range(start.low, None if start.high is None or way is None else start.high + way)
        return Range(None if start.low is None or way is None else start.low + way, start.high)

    def _grown(self, value: str, loop: Loop, made: Instruction) -> Range | None:
        """A value to which some rounds of a loop add a number; None: it is none."""
        start = joined(self.of(one, before) for one, before in self._incoming(made) if before not in loop.blocks)
        rounds = self.rounds(loop)
        if rounds is None or start.low is None or start.high is None:
            return None
        added = [self._growth(one, value, loop, {}) for one, before in self._incoming(made) if before in loop.blocks]
        whole = joined(Range(0, 0) if a is None else a for a in added)
        if None in added or whole.low is None or whole.high is None:
            return None
        return Range(start.low + rounds * min(0, whole.low), start.high + rounds * max(0, whole.high))

    def _growth(self, value: str, since: str, loop: Loop, known: dict[str, Range | None]) -> Range | None:
        """By how much a value is more than another one of the same round; None: nobody knows."""
        if value == since:
            return Range(0, 0)
        if value not in known:
            known[value] = None  # while it is looked for
            known[value] = self._more(value, since, loop, known)
        return known[value]

    def _more(self, value: str, since: str, loop: Loop, known: dict[str, Range | None]) -> Range | None:
        where, made = self._where.get(value, ("", None))
        if made is None or where not in loop.blocks:
            return None
        if (added := added_number(made)) is not None:
            less = self._growth(added[0], since, loop, known)
            return None if less is None else binary("add", ("nsw",), 64, less, Range(added[1], added[1]))
        if made.opcode == "select" and (found := _CHOSEN.match(made.rest)):
            ways = [found[2], found[3]]
        elif made.opcode == "phi" and where not in loop.headers:
            ways = [one for one, _ in self._incoming(made)]
        else:
            return None
        found_of = [self._growth(one, since, loop, known) for one in ways]
        return None if None in found_of else joined(way for way in found_of if way is not None)

    # Rounds

    def rounds(self, loop: Loop) -> int | None:
        """How often a loop goes back to its header at most; None: no bound is found."""
        if loop.header in self._counted:
            self._cuts += 1
            return None
        if loop.header not in self._rounds:
            self._counted.add(loop.header)
            found = self._least(loop)
            self._counted.discard(loop.header)
            self._rounds[loop.header] = None if found is not None and found >= _MOST else found
        return self._rounds[loop.header]

    def join_halves(self) -> None:
        """Takes loops that the compiler made two of for one again, where they have a bound as one alone."""
        for outer, inner in list(self._flow.halves()):
            if inner.header not in self._flow.loops or None not in (self.rounds(outer), self.rounds(inner)):
                continue
            self._flow.join(outer, inner)
            self._rounds.clear()
            self._known.clear()
            if self.rounds(outer) is None:
                self._flow.part(outer, inner)
                self._rounds.clear()

    def _least(self, loop: Loop) -> int | None:
        """The least bound that the conditions on all ways back give."""
        blocks = self._flow.code.blocks
        leaving = sum(s not in loop.blocks for b in loop.blocks for s in blocks[b].successors)
        sole = leaving == 1 and all(blocks[b].successors for b in loop.blocks)
        found: list[tuple[int, bool]] = []
        for latch in loop.latches:
            held = list(self._conditions.at(latch))
            for header in loop.headers & set(blocks[latch].successors):
                held += self._conditions.on_edge(latch, header)
            held += [swapped(condition) for condition in held]
            bounds = [(n, c.predicate == "ne") for c in held if (n := self._bound(c, loop, sole)) is not None]
            if not bounds:
                return None
            found.append(min(bounds))
        most = max(n for n, _ in found)
        # past the one number that it must not be, the other ways back go on
        return None if any(passes for _, passes in found) and any(n != most for n, _ in found) else most

    def _bound(self, condition: Condition, loop: Loop, sole: bool) -> int | None:
        """How often a condition can hold, round after round, for a value that is stepped."""
        condition, less = self._unfolded(condition)
        where = self._where.get(condition.other)
        if where is not None and where[0] in loop.blocks:
            return None
        steps = self._steps(condition.one, loop)
        if steps is None:
            return 1 if self._is_over_after_one(condition, loop) else self._halvings(condition, loop)
        start = self.of(steps.start, steps.before)
        start = Range(*(None if end is None else end + steps.offset - less for end in start))
        end = self.of(condition.other, steps.before)
        predicate, step = condition.predicate, steps.step
        if predicate == "eq" and step != 0:
            return 1
        if predicate[0] == "u":
            # of numbers without sign: it must be known that there is none
            if end.low is None or end.low < 0:
                return None
            # what is taken away by ones alone does not pass the end unseen
            if step < 0 and (start.low is None or start.low < 0 or step < -1):
                return None
            start = Range(max(start.low or 0, 0), start.high)
        if step < 0:
            start, end = (Range(*(None if e is None else -e for e in reversed(r))) for r in (start, end))
            predicate, step = swapped(Condition(predicate, "", "")).predicate, -step
        if step == 0 or start.low is None or end.high is None:
            return None
        if not steps.is_sure and end.high + step >= 1 << (steps.width - 1):
            return None
        if predicate in ("slt", "ult"):
            return max(0, -((start.low - end.high) // step))
        if predicate in ("sle", "ule"):
            return max(0, (end.high - start.low) // step + 1)
        if predicate != "ne":
            return None
        ahead = start.high is not None and end.low is not None and start.high <= end.low
        ends = steps.start, condition.other
        hit = (steps.offset - less) % step == 0 and all(self._is_multiple(value, step) for value in ends)
        # past the end it would go on until it overflows: the compiler knows that it does not
        if not (ahead and hit) and not (steps.is_sure and (sole or ahead)):
            return None
        return max(0, -((start.low - end.high) // step))

    def _unfolded(self, condition: Condition) -> tuple[Condition, int]:
        """Of a difference that is compared with a number: its values compared, the first less that number."""
        made = self._where[condition.one][1] if condition.one in self._where else None
        found = BINARY.match(made.rest) if made is not None and made.opcode == "sub" else None
        number = literal(condition.other).low
        if found is None or number is None or condition.predicate not in ("eq", "ne"):
            return condition, 0
        return Condition(condition.predicate, found[3], found[4]), number

    def _is_multiple(self, value: str, step: int) -> bool:
        """Whether a number is one of a number of steps: as it stands, or by the last bits that are cleared of it."""
        number = literal(value).low
        if number is not None:
            return number % step == 0
        made = self._where[value][1] if value in self._where else None
        if step == 1 or made is None:
            return step == 1
        if (added := added_number(made)) is not None:
            return added[1] % step == 0 and self._is_multiple(added[0], step)
        found = BINARY.match(made.rest) if made.opcode == "and" else None
        mask = literal(found[4]).low if found else None
        return mask is not None and (last_bits(mask) + 1) % step == 0

    def _steps(self, value: str, loop: Loop) -> _Steps | None:
        """How a value is stepped from round to round."""
        offset = 0
        while value in self._where:
            where, made = self._where[value]
            if where not in loop.blocks:
                return None
            if made.opcode == "phi":
                return self._of_header(value, made, loop, offset) if where in loop.headers else None
            added = added_number(made)
            if added is None:
                return None
            value, more, _ = added
            offset += more
        return None

    def _of_header(self, value: str, made: Instruction, loop: Loop, offset: int) -> _Steps | None:
        width = _WORD.match(made.rest)
        outside, steps = set(), set()
        all_sure = True
        own = {value}
        waiting = list(self._incoming(made))
        while waiting:
            one, before = waiting.pop()
            if before not in loop.blocks:
                outside.add((one, before))
                continue
            total = 0
            while one not in own:
                at, made_of = self._where.get(one, ("", None))
                if made_of is not None and made_of.opcode == "phi" and at in loop.headers and total == 0:
                    # of the other header: what comes there comes here
                    own.add(one)
                    waiting += self._incoming(made_of)
                    break
                added = added_number(made_of) if made_of else None
                if added is None:
                    return None
                one, more, never_overflows = added
                total += more
                all_sure = all_sure and never_overflows
            else:
                # from one header to the other it is the same round
                if before != loop.header or not loop.second:
                    steps.add(total)
        if width is None or len(outside) != 1 or len(steps) != 1:
            return None
        ((start, before),) = outside
        return _Steps(start, offset, steps.pop(), all_sure, int(width[1]), before)

    def _is_over_after_one(self, condition: Condition, loop: Loop) -> bool:
        """Whether a condition asks for a value that can be there in the first round alone."""
        where, made = self._where.get(condition.one, ("", None))
        if made is None or made.opcode != "phi" or where != loop.header or condition.predicate != "eq":
            return False
        later = [literal(one) for one, before in self._incoming(made) if before in loop.blocks]
        asked = literal(condition.other)
        return asked != ANY and all(value not in (ANY, asked) for value in later)

    def _halvings(self, condition: Condition, loop: Loop) -> int | None:
        """Rounds of a loop that takes bits from a value until none is left."""
        if condition.predicate != "ne" or condition.other != "0":
            return None
        for made in self._flow.code.blocks[loop.header].instructions:
            if made.opcode != "phi" or not _WORD.match(made.rest):
                continue
            nexts = {one for one, before in self._incoming(made) if before in loop.blocks}
            if len(nexts) == 1 and condition.one in {made.result, *nexts} and self._loses_a_bit(made.result, *nexts):
                found = _WORD.match(made.rest)
                return int(found[1]) if found else None
        return None

    def _loses_a_bit(self, value: str, after: str) -> bool:
        made = self._where[after][1] if after in self._where else None
        found = BINARY.match(made.rest) if made else None
        if made is None or found is None:
            return False
        if made.opcode == "lshr":
            return found[3] == value and found[4].isdigit() and int(found[4]) > 0
        if made.opcode == "and" and value in (found[3], found[4]):
            other = found[4] if found[3] == value else found[3]
            less = added_number(self._where[other][1]) if other in self._where else None
            return less is not None and less[:2] == (value, -1)
        return False
