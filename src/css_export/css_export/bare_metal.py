# SPDX-License-Identifier: Apache-2.0
"""Images for processors without an operating system, run on a whole machine that is emulated.

The C main of a library is linked with newlib, whose files are those of this machine by semihosting, and with a start of
its own. The emulator counts instructions as nanoseconds, so that a timer of the processor counts those of a step.
"""

import re
import subprocess
from pathlib import Path

from css_export.errors import ToolError
from css_export.targets import Target

_IN, _OUT = "in.bin", "out.bin"
_LONGEST_S = 3600
# of a tick of the timer: the machines run it at 25 MHz
_INSTRUCTIONS_A_TICK = 40
_SPECS = ("--specs=rdimon.specs", "-Wl,--no-warn-execstack")

# Arm, "MPS2 and MPS2+ FPGA Prototyping Boards", Application Notes 386 and 500: memory from 0 and from 0x20000000
_SCRIPT = """
ENTRY(_start)
MEMORY { CODE (rx) : ORIGIN = 0, LENGTH = 4M  RAM (rwx) : ORIGIN = 0x20000000, LENGTH = 4M }
SECTIONS
{
  .text : {
    KEEP(*(.vectors)) *(.text*) KEEP(*(.init)) KEEP(*(.fini)) *(.rodata*)
    . = ALIGN(8);
    __preinit_array_start = .; KEEP(*(.preinit_array*)) __preinit_array_end = .;
    __init_array_start = .; KEEP(*(SORT(.init_array.*))) KEEP(*(.init_array*)) __init_array_end = .;
    __fini_array_start = .; KEEP(*(SORT(.fini_array.*))) KEEP(*(.fini_array*)) __fini_array_end = .;
  } > CODE
  .ARM.extab : { *(.ARM.extab*) } > CODE
  .ARM.exidx : { __exidx_start = .; *(.ARM.exidx*) __exidx_end = .; } > CODE
  .data : { *(.data*) } > RAM
  .bss : { __bss_start__ = .; *(.bss*) *(COMMON) __bss_end__ = .; } > RAM
  . = ALIGN(8);
  end = .; __end__ = .;
  top_of_stack = ORIGIN(RAM) + LENGTH(RAM);
}
"""
_START = f"""
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

extern uint32_t top_of_stack[];
extern void _start(void);

static void reset(void)
{{
    *(volatile uint32_t *)0xE000ED88u |= 0xFu << 20; /* CPACR: the unit of floating point on */
    __asm volatile("dsb\\n\\tisb");
    _start();
}}

static void fault(void)
{{
    fputs("fault of the processor\\n", stderr);
    exit(1);
}}

static const struct {{
    uint32_t *stack;
    void (*handlers[15])(void);
}} vectors __attribute__((section(".vectors"), used)) = {{
    top_of_stack, {{reset, fault, fault, fault, fault, fault, 0, 0, 0, 0, 0, 0, 0, 0, 0}}}};

__attribute__((constructor)) static void redirect(void)
{{
    if (freopen("{_IN}", "rb", stdin) == NULL || freopen("{_OUT}", "wb", stdout) == NULL) {{
        exit(1);
    }}
}}
"""


def _counting(symbol: str) -> str:
    """A function that stands around another and counts ticks; the linker puts it in the other's place."""
    arguments = "const void *p, void *s, const void *i, void *o"
    return f"""
#include <stdint.h>
#include <stdio.h>

#define TIMER ((volatile uint32_t *)0xE000E010u) /* SysTick of Armv7-M: control, reload, value */

static uint32_t most;
static int over;

void __real_{symbol}({arguments});
void __wrap_{symbol}({arguments});
void __wrap_{symbol}({arguments})
{{
    uint32_t ticks;
    TIMER[1] = 0xFFFFFFu;
    TIMER[2] = 0;
    TIMER[0] = 5;
    ticks = TIMER[2];
    __real_{symbol}(p, s, i, o);
    ticks = (ticks - TIMER[2]) & 0xFFFFFFu;
    over |= (TIMER[0] >> 16) & 1;
    most = ticks > most ? ticks : most;
}}

__attribute__((destructor)) static void tell(void)
{{
    fprintf(stderr, over ? "over\\n" : "ticks %lu\\n", (unsigned long)most);
}}
"""


def write_machine(place: Path) -> None:
    """Writes the start of an image and the memory of the machine, `start.c` and `machine.ld`.

    Raises:
        OSError: they cannot be written.
    """
    for name, text in (("start.c", _START), ("machine.ld", _SCRIPT)):
        (place / name).write_text(f"/* SPDX-License-Identifier: Apache-2.0 */{text}", encoding="utf-8")


def machine_flags(place: str) -> list[str]:
    """What the compiler is told to link an image, with the files of `write_machine` in a folder."""
    return [*_SPECS, "-T", f"{place}/machine.ld", f"{place}/start.c"]


def run_flags(target: Target, image: str) -> list[str]:
    """The command that runs an image, which reads `in.bin` and writes `out.bin` where it is run."""
    command = [target.emulator, "-M", target.machine, "-nographic", "-monitor", "none", "-serial", "none"]
    return [*command, "-icount", "shift=0", "-semihosting-config", "enable=on,target=native", "-kernel", image]


def image_command(image: Path, counted: str = "") -> list[str]:
    """Writes what an image needs beside its own sources, and what its compiler is to be told.

    Args:
        image: where it will be.
        counted: symbol of a function whose instructions are to be counted; "": none.
    """
    place = image.parent
    write_machine(place)
    if not counted:
        return machine_flags(str(place))
    count = place / "count.c"
    count.write_text(f"/* SPDX-License-Identifier: Apache-2.0 */{_counting(counted)}", encoding="utf-8")
    return [*machine_flags(str(place)), f"-Wl,--wrap={counted}", str(count)]


def run_image(target: Target, image: Path, stream: bytes) -> tuple[bytes, int | None]:
    """What an image writes for what it is given, and the instructions of the longest call that it counted.

    Raises:
        ToolError: it failed.
    """
    place = image.parent
    (place / _IN).write_bytes(stream)
    (place / _OUT).unlink(missing_ok=True)
    command = run_flags(target, image.name)
    try:
        done = subprocess.run(
            command, cwd=place, stdin=subprocess.DEVNULL, capture_output=True, check=False, timeout=_LONGEST_S
        )
        written = (place / _OUT).read_bytes()
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ToolError(f"{' '.join(command)}: {error}") from error
    finally:
        (place / _IN).unlink(missing_ok=True)
        (place / _OUT).unlink(missing_ok=True)
    said = done.stderr.decode(errors="replace").strip()
    if done.returncode != 0:
        raise ToolError(f"{' '.join(command)}: ended with {done.returncode}: {said}")
    ticks = re.search(r"^ticks (\d+)$", said, re.MULTILINE)
    return written, int(ticks[1]) * _INSTRUCTIONS_A_TICK if ticks else None
