# SPDX-License-Identifier: Apache-2.0
"""What builds a library into a program, and the page that explains it."""

from pathlib import Path

from css_common.whole_files import write_whole
from css_export.bare_metal import machine_flags, run_flags, write_machine
from css_export.flown import INPUT, OUTPUT, PARAMETERS, STATE
from css_export.library import Library, MachineCode
from css_export.operations import at_most
from css_export.targets import Target


def write_build_files(library: Library, codes: list[MachineCode], folder: Path) -> None:
    """Writes Makefile, CMakeLists.txt and README.md beside a library.

    Raises:
        OSError: they cannot be written.
    """
    texts = {
        "Makefile": makefile(library, codes),
        "CMakeLists.txt": cmake(library, codes),
        "README.md": page(library, codes),
    }
    for code in codes:
        if code.target.machine:
            write_machine(folder / code.target.name)
    for name, text in texts.items():
        write_whole(folder / name, text)


def makefile(library: Library, codes: list[MachineCode]) -> str:
    """A Makefile that links the C main for a target."""
    prefix = library.prefix
    compilers = "".join(_compiler(code.target) for code in codes)
    return f"""# SPDX-License-Identifier: Apache-2.0
# make TARGET={codes[0].target.name} [CFLAGS=...]: the C main, linked with the library of a target.
TARGET ?= {codes[0].target.name}
CFLAGS ?= -std=c99 -O1 -Wall -Wextra -Wpedantic
{compilers}
$(TARGET)/{prefix}_main: {prefix}_main.c {prefix}.h $(TARGET)/lib{prefix}.a
\t$(CC_$(TARGET)) $(CFLAGS) -o $@ {prefix}_main.c $(TARGET)/lib{prefix}.a $(WITH_$(TARGET)) -lm

.PHONY: clean
clean:
\trm -f */{prefix}_main
"""


def _compiler(target: Target) -> str:
    """Which compiler a Makefile takes for a target, and what it needs beside the C main."""
    if not target.compiler:
        return f"CC_{target.name} ?= $(error no compiler is known for {target.name}: give CC_{target.name}=...)\n"
    flags = (*target.flags, *(("-static",) if target.emulator and not target.machine else ()))
    text = f"CC_{target.name} ?= {' '.join((target.compiler, *flags))}\n"
    return text + (f"WITH_{target.name} = {' '.join(machine_flags(target.name))}\n" if target.machine else "")


def cmake(library: Library, codes: list[MachineCode]) -> str:
    """A CMakeLists.txt that offers the library of a target to others."""
    prefix = library.prefix
    return f"""# SPDX-License-Identifier: Apache-2.0
# add_subdirectory() this folder and link {prefix}; SUNPOINT_TARGET chooses the processor.
cmake_minimum_required(VERSION 3.13)
project({prefix} C)

set(SUNPOINT_TARGET "{codes[0].target.name}" CACHE STRING "one of: {" ".join(code.target.name for code in codes)}")
add_library({prefix} STATIC IMPORTED GLOBAL)
set_target_properties({prefix} PROPERTIES
  IMPORTED_LOCATION "${{CMAKE_CURRENT_LIST_DIR}}/${{SUNPOINT_TARGET}}/lib{prefix}.a"
  INTERFACE_INCLUDE_DIRECTORIES "${{CMAKE_CURRENT_LIST_DIR}}"
  INTERFACE_LINK_LIBRARIES m)

if(CMAKE_SOURCE_DIR STREQUAL CMAKE_CURRENT_LIST_DIR)
  add_executable({prefix}_main {prefix}_main.c)
  target_link_libraries({prefix}_main {prefix})
endif()
"""


def page(library: Library, codes: list[MachineCode]) -> str:
    """README.md of a library."""
    prefix, structs = library.prefix, library.interface.structs
    rows = "".join(
        f"| {c.target.name} | {c.contents.code} | {c.contents.constants} | {c.stack} | "
        f"{', '.join(f'`{name}`' for name in c.contents.missing) or '-'} |\n"
        for c in codes
    )
    bounds = "".join(f"* {c.target.name}: {at_most(c.bound)}.\n" for c in codes)
    loose = sorted({limit.name.partition("[")[0] for limit in library.limits if not limit.declared})
    named = ": " + ", ".join(f"`{name}`" for name in loose) if loose else ""
    return f"""# {prefix}

{library.function.about}

{library.version}

Made by `sunpoint export`; changes are lost. Licence of header, sources and objects: Apache-2.0.

## Interface

`{prefix}.h` holds four structs and three functions:

| struct | bytes | |
|---|---:|---|
| `{prefix}_params` | {structs[PARAMETERS].size} | parameters; `{prefix}_mission` has those of the mission |
| `{prefix}_state` | {structs[STATE].size} | carried from step to step, one for each instance |
| `{prefix}_in` | {structs[INPUT].size} | what a step is given |
| `{prefix}_out` | {structs[OUTPUT].size} | what a step gives |

    {prefix}_state state;
    {prefix}_init(&state);
    for (;;) {{
        {prefix}_in in = ...;   /* units and frames: in the header */
        {prefix}_out out;
        {prefix}_step(&{prefix}_mission, &state, &in, &out);
    }}

No function allocates or keeps anything but what it is given: any number of instances, from any thread, each with a
state of its own. Nothing in it changes but `state` and `out`. Flags are 0 or 1; any other value of a flag counts as 1.

`{prefix}_init` sets the state up for the parameters of the mission: where a start depends on a parameter (a variance
at the start), one that was changed later does not change it.

Parameters of your own (an uplink): copy `{prefix}_mission`, change members, ask `{prefix}_check`. It gives -1, or which
row of `{prefix}_limits` is not kept. Members that are made of one parameter have that parameter's limits, as strict as
the node's. Of others it asks that they are finite numbers{named}.
What two parameters must be to each other is checked when the mission is read, not here.

## Sizes

| target | code | read-only data | stack of a step | to be linked |
|---|---:|---:|---:|---|
{rows}
All in bytes. The stack is what the compiler lays out for the step and the functions of this library below it; what is
linked comes to it. No function calls itself.

## The longest step

{bounds}
An operation is an instruction of the compiler's intermediate code, after optimisation for the target. The longest way
through the code is taken, with each loop as often as its numbers allow, be there an input that takes it or not. What a
function that is linked does comes to it. Whole numbers of the parameters are taken within their limits, those without
limits as the mission has them.

## `{prefix}_main.c`

Reads records from standard input, each a word of 64 bits and what belongs to it: 1, then `{prefix}_in`: one step;
2: the state is set up anew; 3, then `{prefix}_params`: parameters from now on, which it checks; 4, then the state: from
there on; 5: it writes `{prefix}_layout`, the number of the structs of the header. For each step it writes
`{prefix}_out` and a hash of the state (`hash_of_state`), with any argument the state itself.
`make TARGET={codes[0].target.name}` builds it.
{_bare(prefix, codes)}"""


def _bare(prefix: str, codes: list[MachineCode]) -> str:
    """What is said of targets without an operating system, and of those that are not run."""
    text = ""
    for target in (code.target for code in codes):
        if target.machine:
            command = " ".join(run_flags(target, f"{target.name}/{prefix}_main"))
            text += f"""
For {target.name}, `start.c` and `machine.ld` in its folder make an image, which reads `in.bin` and writes `out.bin`:

    {command}
"""
    names = ", ".join(code.target.name for code in codes if not code.target.runs)
    return text + (
        f"\n## Not run\n\n{names}: objects were made, and no instruction of them was run.\n" if names else ""
    )
