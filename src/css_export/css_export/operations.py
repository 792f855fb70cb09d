# SPDX-License-Identifier: Apache-2.0
"""How many operations a function makes at most, from its intermediate code after optimisation, and where nobody knows.

An operation is an instruction of that code but for those that stand for none: where ways meet, what is told to the
compiler alone. Copying and clearing memory counts one for each word of 64 bits. A function of mathematics, linked or
shipped with the library, counts one and is counted by its name. The longest way through the blocks is taken, each loop
as often as it goes round at most.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from css_export.code_loops import Flow, Loop
from css_export.code_ranges import Ranges
from css_export.code_text import Code, Instruction, callee, functions_of, is_call
from css_export.errors import ExportError
from css_export.names import of_python
from css_export.range_arithmetic import ANY, Range
from css_export.shipped_mathematics import EXACT, PREFIX

OPERATIONS = ""
"""Under which operations are counted; C functions are under their names."""
_NONE = ("phi", "unreachable")
_TOLD = ("lifetime", "assume", "dbg", "experimental.noalias", "invariant", "donothing")
_MEMORY = ("memset", "memcpy", "memmove")
# of LLVM's own functions, those of whole numbers
_WHOLE = frozenset(
    [
        "smin",
        "smax",
        "umin",
        "umax",
        "abs",
        "ctpop",
        "cttz",
        "ctlz",
        "bswap",
        "bitreverse",
        "fshl",
        "fshr",
        "is",
        "sadd",
        "ssub",
        "smul",
        "uadd",
        "usub",
        "umul",
        "expect",
        "ucmp",
        "scmp",
        "fptosi",
        "fptoui",
        "vector",
        "masked",
    ]
)
_REAL = EXACT | {"minimum", "maximum", "fmuladd", "canonicalize", "minimumnum", "maximumnum"}

Cost = dict[str, int]


@dataclass(frozen=True)
class Bound:
    """Of a step.

    Attributes:
        operations: at most; None: no bound was found.
        calls: of functions of mathematics, at most, by their names.
        reason: what has no bound; "": all has.
    """

    operations: int | None
    calls: Cost = field(default_factory=dict)
    reason: str = ""


NOT_ASKED = Bound(None)


def at_most(bound: Bound) -> str:
    """A bound in words."""
    if bound.operations is None:
        return f"operations of a step: {bound.reason}"
    calls = ", ".join(f"{name} {count}" for name, count in sorted(bound.calls.items()))
    return f"a step makes at most {bound.operations} operations" + (f", with calls of {calls}" if calls else "")


class _NoBoundError(Exception):
    """Something goes on for as long as its numbers say; the text says what."""


def bound_of(text: str, function: str, whole_numbers: Iterable[tuple[int, int, int]] = ()) -> Bound:
    """How many operations a function of a module makes at most.

    Args:
        text: of the module, optimised.
        function: of which the first argument points to the parameters.
        whole_numbers: place [bytes] in the parameters, least and largest value of those that are whole numbers.
    """
    codes = functions_of(text)
    numbers = {at: Range(low, high) for at, low, high in whole_numbers}
    arguments = [ANY] * len(codes[function].arguments)
    try:
        cost = _Bounds(codes, numbers).of(function, tuple(arguments), 0)
    except (_NoBoundError, ExportError) as error:
        return Bound(None, {}, str(error))
    return Bound(cost.pop(OPERATIONS, 0), cost)


class _Bounds:
    """Of the functions of a module."""

    def __init__(self, codes: Mapping[str, Code], numbers: Mapping[int, Range]) -> None:
        self._codes, self._numbers = codes, numbers
        self._flows: dict[str, Flow] = {}
        self._known: dict[tuple[str, tuple[Range, ...], int | None], Cost] = {}

    def of(self, function: str, arguments: tuple[Range, ...], parameters: int | None) -> Cost:
        """Of a function for given ranges of its arguments.

        Args:
            function: its name.
            arguments: ranges of them.
            parameters: which of them points to the parameters; None: none does.
        """
        key = function, arguments, parameters
        if key not in self._known:
            if function not in self._flows:
                self._flows[function] = Flow(self._codes[function])
            flow = self._flows[function]
            names = flow.code.arguments
            pointer = names[parameters] if parameters is not None and names else ""
            ranges = Ranges(flow, dict(zip(names, arguments, strict=False)), pointer, self._numbers)
            ranges.join_halves()
            self._known[key] = self._longest(flow, ranges, None)
        return dict(self._known[key])

    def _longest(self, flow: Flow, ranges: Ranges, loop: Loop | None) -> Cost:
        """The longest way through a loop, as often as it goes round, or through the whole function."""
        code, inside = flow.code, [name for name in flow.order if loop is None or name in loop.blocks]
        place = {name: _place(flow, name, loop) for name in inside}
        before: dict[str, set[str]] = {name: set() for name in place.values()}
        for name in inside:
            for other in code.blocks[name].successors:
                back = loop is not None and name in loop.latches and other in loop.headers
                if other in place and place[other] != place[name] and not back:
                    before[place[other]].add(place[name])
        reached: dict[str, Cost] = {}
        for name in inside:
            # a loop in it stands in the place of its header
            if place[name] != name:
                continue
            within = flow.loops.get(name)
            if within is not None and within is not loop:
                own = self._longest(flow, ranges, within)
            else:
                own = self._of_block(flow, ranges, name)
            reached[name] = _sum(_most(reached[other] for other in before[name]), own)
        if loop is None:
            return _most(reached.values())
        rounds = ranges.rounds(loop)
        if rounds is None:
            label = of_python(loop.header.partition(".exit")[0])
            raise _NoBoundError(f"no bound was found of a loop of {of_python(code.name)}, at {label}")
        once = _most(reached[place[name]] for name in loop.latches)
        leaves = [name for name in inside if not set(code.blocks[name].successors) <= loop.blocks]
        last = _most(reached[place[name]] for name in [*leaves, *(n for n in inside if not code.blocks[n].successors)])
        return _sum({kind: rounds * count for kind, count in once.items()}, last)

    def _of_block(self, flow: Flow, ranges: Ranges, name: str) -> Cost:
        total: Cost = {}
        for made in flow.code.blocks[name].instructions:
            called = callee(made) if is_call(made) else None
            lengths = []
            if called is not None:
                if called[0] in self._codes and not called[0].startswith(PREFIX):
                    given = tuple(ranges.of(argument, name) for argument in called[1])
                    handed = called[1].index(ranges.pointer) if ranges.pointer in called[1] else None
                    total = _sum(total, self.of(called[0], given, handed))
                lengths = [ranges.of(argument, name) for argument in called[1][2:3]]
            total = _sum(total, cost_of(made, self._codes, lengths, flow.code.name))
        return total


def cost_of(made: Instruction, codes: Iterable[str], lengths: Iterable[Range], function: str) -> Cost:
    """Of an instruction alone, without the function of the module that it calls.

    Args:
        made: the instruction.
        codes: functions of the module.
        lengths: third argument of a call.
        function: in which it stands.
    """
    if made.opcode in _NONE:
        return {}
    if not is_call(made):
        return {OPERATIONS: 1}
    called = callee(made)
    if called is None:
        raise _NoBoundError(f"{of_python(function)} calls a function whose name is not known")
    # shipped with the library or linked: it is counted by its name
    name = called[0].removeprefix(PREFIX)
    if name == called[0] and name in codes:
        return {OPERATIONS: 1}
    if not name.startswith("llvm."):
        # what IEEE 754 defines is an operation, be it an instruction of the processor or none
        return {OPERATIONS: 1} if name in EXACT else {OPERATIONS: 1, name: 1}
    kind = name.removeprefix("llvm.").split(".")
    if kind[0] in _TOLD or ".".join(kind[:2]) in _TOLD:
        return {}
    if kind[0] in _MEMORY:
        longest = next(iter(lengths), ANY).high
        if longest is None:
            raise _NoBoundError(f"{of_python(function)}: {kind[0]} of a length that is not known")
        return {OPERATIONS: 1 + -(-longest // 8)}
    if kind[0] in _WHOLE or kind[0] in _REAL:
        return {OPERATIONS: 1}
    return {OPERATIONS: 1, kind[0]: 1}


def _place(flow: Flow, name: str, loop: Loop | None) -> str:
    """In whose place a block stands: its own, or that of the header of a loop around it, inside of `loop`."""
    around = flow.innermost(name)
    while around is not None and around is not loop:
        name, around = around.header, around.inside
    return name


def _most(costs: Iterable[Cost]) -> Cost:
    most: Cost = {}
    for cost in costs:
        for kind, count in cost.items():
            most[kind] = max(most.get(kind, 0), count)
    return most


def _sum(one: Cost, other: Cost) -> Cost:
    total = dict(one)
    for kind, count in other.items():
        total[kind] = total.get(kind, 0) + count
    return total
