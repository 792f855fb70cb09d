# SPDX-License-Identifier: Apache-2.0
"""LLVM's intermediate code, read from its text: functions, their blocks, and of instructions what a bound hangs on."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

NAME = r'(?:"[^"]+"|[\w.$-]+)'
VALUE = rf"(?:%{NAME}|@{NAME}|-?\d+|true|false)"
_DEFINED = re.compile(rf"^define [^@]*@({NAME})\((.*)\) ?[^()]*\{{$")
_LABEL = re.compile(rf"^({NAME}):")
_RESULT = re.compile(rf"^(%{NAME}) = (.*)$")
_TARGETS = re.compile(rf"label %({NAME})")
_CALLEE = re.compile(rf"^[^@]*?@({NAME})\(")
_RAISED = re.compile(rf"^(%{NAME}) = (?:tail )?call .*@llvm\.uadd\.with\.overflow\.(i\d+)\(i\d+ ({VALUE}), i\d+ 1\)")
_TAKEN_OUT = re.compile(rf"^(%{NAME}) = extractvalue \{{ i\d+, i1 \}} (%{NAME}), ([01])$")
_BRACKETS = {"(": 1, "{": 1, "[": 1, "<": 1, ")": -1, "}": -1, "]": -1, ">": -1}
_CALL_WORDS = ("tail", "musttail", "notail")


@dataclass(frozen=True)
class Instruction:
    """One instruction.

    Attributes:
        result: name of its value with the sign before it; "": it has none.
        opcode: as LLVM names it.
        rest: what stands behind that.
    """

    result: str
    opcode: str
    rest: str


@dataclass
class Block:
    """Instructions that follow one another, and the blocks that may come then.

    Attributes:
        at: number of the line of the text where its first instruction stands that is none of `phi`.
    """

    name: str
    at: int = -1
    instructions: list[Instruction] = field(default_factory=list)
    successors: tuple[str, ...] = ()


@dataclass(frozen=True)
class Code:
    """A function.

    Attributes:
        arguments: names of them, with the sign before each.
        blocks: by name; it begins with the first.
    """

    name: str
    arguments: tuple[str, ...]
    blocks: dict[str, Block]


def functions_of(text: str) -> dict[str, Code]:
    """The functions of a module, by name."""
    found: dict[str, Code] = {}
    lines = iter(enumerate(text.splitlines()))
    for _, line in lines:
        head = _DEFINED.match(line)
        if head:
            arguments = tuple(words[-1] for part in parts(head[2]) if (words := part.split()))
            found[plain(head[1])] = Code(plain(head[1]), arguments, _blocks(lines))
    return found


def _blocks(lines: Iterator[tuple[int, str]]) -> dict[str, Block]:
    blocks: dict[str, Block] = {}
    block: Block | None = None
    raised: dict[str, tuple[str, str]] = {}
    for at, line in lines:
        if line == "}":
            break
        label = _LABEL.match(line)
        if label:
            block = blocks.setdefault(plain(label[1]), Block(plain(label[1])))
            continue
        if not line.startswith("  ") or line.lstrip().startswith((";", "#dbg")):
            continue
        if block is None:
            # the first block of a function needs no name
            block = blocks.setdefault("", Block(""))
        told = line.strip()
        if told.startswith("switch ") and not told.endswith("]"):
            told += " ".join(["", *_until_closed(lines)])
        told = _plainly(told, raised)
        result = _RESULT.match(told)
        opcode, _, rest = (result[2] if result else told).partition(" ")
        block.instructions.append(Instruction(result[1] if result else "", opcode, rest))
        if block.at < 0 and opcode != "phi":
            block.at = at
        if opcode in ("br", "switch"):
            block.successors = tuple(dict.fromkeys(plain(name) for name in _TARGETS.findall(rest)))
    return blocks


def _plainly(told: str, raised: dict[str, tuple[str, str]]) -> str:
    """An instruction; a sum with one and its overflow, by which LLVM counts rounds, as those of the number itself.

    Args:
        told: the instruction.
        raised: pairs of such sums and overflows, each with the type and the number; changed.
    """
    made, taken = _RAISED.match(told), _TAKEN_OUT.match(told)
    if made:
        raised[made[1]] = made[2], made[3]
    elif taken and taken[2] in raised:
        kind, number = raised[taken[2]]
        return f"{taken[1]} = " + (f"add {kind} {number}, 1" if taken[3] == "0" else f"icmp eq {kind} {number}, -1")
    return told


def _until_closed(lines: Iterator[tuple[int, str]]) -> Iterator[str]:
    for _, line in lines:
        yield line.strip()
        if line.strip().startswith("]"):
            return


def plain(name: str) -> str:
    """A name without quotation marks."""
    return name.strip('"')


def parts(text: str) -> list[str]:
    """What stands between commas, of those outside all brackets and quotations."""
    found, depth, begun, quoted = [], 0, 0, False
    for at, sign in enumerate(text):
        if sign == '"':
            quoted = not quoted
        elif quoted:
            continue
        elif sign == "," and depth == 0:
            found.append(text[begun:at].strip())
            begun = at + 1
        depth += _BRACKETS.get(sign, 0)
    last = text[begun:].strip()
    return [*found, last] if last else found


def callee(instruction: Instruction) -> tuple[str, list[str]] | None:
    """Name of the function that a call is of, and its arguments as values; None where no name stands there."""
    head = _CALLEE.match(instruction.rest)
    if head is None:
        return None
    begun, depth = head.end(), 1
    for at in range(begun, len(instruction.rest)):
        depth += {"(": 1, ")": -1}.get(instruction.rest[at], 0)
        if depth == 0:
            given = parts(instruction.rest[begun:at])
            return plain(head[1]), [part.split()[-1] for part in given]
    return None


def is_call(instruction: Instruction) -> bool:
    """Whether it calls something."""
    return instruction.opcode in ("call", "invoke", *_CALL_WORDS)
