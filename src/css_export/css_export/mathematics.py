# SPDX-License-Identifier: Apache-2.0
"""Which functions of the C library give other bits on another processor than on this one.

Where a step differs, the reason is one of the functions that the library links: each is asked for the same arguments
on both, and the bits are compared.
"""

import re
import struct
from collections.abc import Iterable
from pathlib import Path

from css_export.programs import compiled_program, run_program
from css_export.targets import HOST, TARGETS, Target

_TO_ONE = ("acos", "asin", "atanh", "log", "log10", "log1p", "log2", "pow", "sqrt")  # for arguments from 0 to 1
_OF_ONE = (
    "acos", "asin", "asinh", "atan", "atanh", "cbrt", "ceil", "cos", "cosh", "erf", "erfc", "exp", "exp2", "expm1",
    "floor", "log", "log10", "log1p", "log2", "rint", "round", "sin", "sinh", "sqrt", "tan", "tanh", "tgamma", "trunc",
)  # fmt: skip
_OF_TWO = ("atan2", "fmod", "hypot", "pow")
_NO_NUMBERS = re.compile(r"mem(cpy|move|set)|_.*")  # of memory, and of the compiler's runtime
ARGUMENTS = 20000


def differing_functions(linked: list[str], target: Target, folder: Path) -> dict[str, float]:
    """Share of arguments for which a linked function gives other bits than here, by its name; those that do alone.

    Args:
        linked: names that a library links.
        target: the other processor.
        folder: where the program goes.

    Raises:
        ToolError: it cannot be compiled or run.
    """
    names = {"sin", "cos"} if "sincos" in linked else set()
    asked = sorted((names | set(linked)) & {*_OF_ONE, *_OF_TWO})
    if not asked:
        return {}
    source = folder / "mathematics.c"
    source.write_text(program_text(asked), encoding="utf-8")
    given = []
    for one in (TARGETS[HOST], target):
        program = compiled_program(one, [source], [], folder / f"mathematics_{one.name}")
        given.append(run_program(one, program, b""))
    orders = ("<", ">" if target.big_endian else "<")
    here, there = (struct.unpack(f"{o}{len(asked) * ARGUMENTS}Q", d) for o, d in zip(orders, given, strict=True))
    shares = {}
    for k, name in enumerate(asked):
        rows = slice(k * ARGUMENTS, (k + 1) * ARGUMENTS)
        other = sum(a != b for a, b in zip(here[rows], there[rows], strict=True))
        if other:
            shares[name] = other / ARGUMENTS
    return shares


def not_asked(linked: Iterable[str]) -> list[str]:
    """Functions that a library links and that nobody compares: a difference may come from them."""
    asked = {*_OF_ONE, *_OF_TWO, "sincos"}
    return sorted(name for name in linked if name not in asked and not _NO_NUMBERS.fullmatch(name))


def program_text(names: list[str]) -> str:
    """A program in C that writes what each function gives for arguments from -4 to 4, or for some from 0 to 1."""
    calls = "".join(_call(name) for name in names)
    return f"""/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>

static uint64_t drawn;

/* from 0 to 1; a linear congruential generator (Knuth, MMIX) */
static double draw(void)
{{
    drawn = drawn * 6364136223846793005u + 1442695040888963407u;
    return (double)(drawn >> 11) / 9007199254740992.0;
}}

int main(void)
{{
    volatile double x, y, given;
    int k;
{calls}    return fflush(stdout) == 0 ? 0 : 1;
}}
"""


def _call(name: str) -> str:
    arguments = "x, y" if name in _OF_TWO else "x"
    return f"""    drawn = 1;
    for (k = 0; k < {ARGUMENTS}; k++) {{
        x = {"draw()" if name in _TO_ONE else "8.0 * draw() - 4.0"};
        y = 8.0 * draw() - 4.0;
        given = {name}({arguments});
        (void)y;
        if (fwrite((const void *)&given, sizeof given, 1, stdout) != 1) {{
            return 1;
        }}
    }}
"""
