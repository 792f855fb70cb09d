# SPDX-License-Identifier: Apache-2.0
"""Which blocks of a function every way passes, and its loops (Aho, Lam, Sethi & Ullman, Compilers, section 9.6)."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from css_export.code_text import Code
from css_export.errors import ExportError


@dataclass
class Loop:
    """Blocks that may be passed again and again.

    Attributes:
        header: the block through which alone it is entered.
        latches: from which it goes back there.
        blocks: all of it, with those of the loops in it.
        inside: the loop around it, None: there is none.
        second: where some of the latches lead instead, behind the header; "": there is no such block.
    """

    header: str
    latches: set[str] = field(default_factory=set)
    blocks: set[str] = field(default_factory=set)
    inside: "Loop | None" = None
    second: str = ""

    @property
    def headers(self) -> set[str]:
        """Blocks to which its latches lead."""
        return {self.header, self.second} - {""}


class Flow:
    """Order, dominators and loops of the blocks that can be reached.

    Attributes:
        order: reverse postorder.
        predecessors: of each block.
        above: the immediate dominator of each block but the first.
        loops: by header, outer ones first.
    """

    def __init__(self, code: Code) -> None:
        """Looks through a function.

        Raises:
            ExportError: it has a circle that is entered at several blocks.
        """
        self.code = code
        self.order = _order(code)
        place = {name: k for k, name in enumerate(self.order)}
        self.predecessors: dict[str, list[str]] = {name: [] for name in self.order}
        for name in self.order:
            for other in code.blocks[name].successors:
                self.predecessors[other].append(name)
        self.above = self._dominators(place)
        self.loops = self._loops(place)
        # outer ones come first
        self._innermost = {name: loop for loop in self.loops.values() for name in loop.blocks}

    def dominates(self, one: str, other: str) -> bool:
        """Whether every way to `other` passes `one`."""
        while other != one:
            if other not in self.above:
                return False
            other = self.above[other]
        return True

    def innermost(self, block: str) -> Loop | None:
        """The smallest loop that a block is in."""
        return self._innermost.get(block)

    def halves(self) -> Iterator[tuple[Loop, Loop]]:
        """Loops of which the outer one does nothing before it comes to the inner one.

        The compiler makes two such loops of one that goes on in two ways.
        """
        for inner in self.loops.values():
            outer = inner.inside
            if outer and not outer.second and self.code.blocks[outer.header].successors == (inner.header,):
                yield outer, inner

    def join(self, outer: Loop, inner: Loop) -> None:
        """Takes two of `halves` for one loop."""
        del self.loops[inner.header]
        outer.second = inner.header
        outer.latches |= inner.latches
        for loop in self.loops.values():
            if loop.inside is inner:
                loop.inside = outer
        for name, loop in self._innermost.items():
            if loop is inner:
                self._innermost[name] = outer

    def part(self, outer: Loop, inner: Loop) -> None:
        """Takes back `join`."""
        outer.second = ""
        outer.latches -= inner.latches
        self.loops[inner.header] = inner
        for loop in self.loops.values():
            if loop.inside is outer and loop is not inner and loop.header in inner.blocks:
                loop.inside = inner
        for name, loop in self._innermost.items():
            if loop is outer and name in inner.blocks:
                self._innermost[name] = inner

    def _dominators(self, place: dict[str, int]) -> dict[str, str]:
        # Cooper, Harvey & Kennedy, A Simple, Fast Dominance Algorithm (2001)
        above: dict[str, str] = {}
        first = self.order[0]
        changed = True
        while changed:
            changed = False
            for name in self.order[1:]:
                known = [p for p in self.predecessors[name] if p == first or p in above]
                new = known[0]
                for other in known[1:]:
                    while new != other:
                        if place[new] > place[other]:
                            new = above[new]
                        else:
                            other = above[other]
                if above.get(name) != new:
                    above[name] = new
                    changed = True
        return above

    def _loops(self, place: dict[str, int]) -> dict[str, Loop]:
        loops: dict[str, Loop] = {}
        for name in self.order:
            for other in self.code.blocks[name].successors:
                if place[other] > place[name]:
                    continue
                if not self.dominates(other, name):
                    raise ExportError(f"a circle of {self.code.name} that is entered at {other!r} and elsewhere")
                loops.setdefault(other, Loop(other)).latches.add(name)
        for loop in loops.values():
            loop.blocks = {loop.header}
            waiting = list(loop.latches)
            while waiting:
                name = waiting.pop()
                if name not in loop.blocks:
                    loop.blocks.add(name)
                    waiting += self.predecessors[name]
        ordered = sorted(loops.values(), key=lambda loop: (-len(loop.blocks), place[loop.header]))
        for k, loop in enumerate(ordered):
            around = [other for other in ordered[:k] if loop.header in other.blocks]
            loop.inside = around[-1] if around else None
        return {loop.header: loop for loop in ordered}


def _order(code: Code) -> list[str]:
    first = next(iter(code.blocks))
    seen, after = {first}, []
    waiting = [(first, iter(code.blocks[first].successors))]
    while waiting:
        name, others = waiting[-1]
        other = next((o for o in others if o not in seen), None)
        if other is None:
            after.append(name)
            waiting.pop()
        else:
            seen.add(other)
            waiting.append((other, iter(code.blocks[other].successors)))
    return after[::-1]
