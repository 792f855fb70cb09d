# SPDX-License-Identifier: Apache-2.0
"""Processors that code is made for, and what compiles and runs it on this machine."""

from typing import NamedTuple

from css_common.schema import unknown_name
from css_export.errors import ExportError


class Target(NamedTuple):
    """A kind of processor.

    Attributes:
        triple: as LLVM names it.
        processor: as LLVM names it; "" for the least of its kind.
        features: as LLVM names them.
        abi: as LLVM names it; "": the usual one.
        compiler: that links a program for it with a C library; "": none is known.
        flags: for that compiler.
        package: of Debian that brings it.
        emulator: that runs such a program here; "": the program runs as it is.
        machine: that the emulator has for it, where it is one of whole machines; "": one of programs.
        emulator_package: of Debian that brings the emulator.
        big_endian: its numbers begin with the most significant byte.
        runs: a program for it can be run here, with the emulator.
    """

    name: str
    triple: str
    processor: str = ""
    features: str = ""
    abi: str = ""
    compiler: str = ""
    flags: tuple[str, ...] = ()
    package: str = ""
    emulator: str = ""
    machine: str = ""
    emulator_package: str = "qemu-user-static"
    big_endian: bool = False
    runs: bool = True


_BARE = "gcc-arm-none-eabi libnewlib-arm-none-eabi"
_TARGETS = (
    Target("x86_64", "x86_64-unknown-linux-gnu", "x86-64", compiler="gcc", package="gcc libc6-dev"),
    Target(
        "aarch64",
        "aarch64-unknown-linux-gnu",
        compiler="aarch64-linux-gnu-gcc",
        package="gcc-aarch64-linux-gnu libc6-dev-arm64-cross",
        emulator="qemu-aarch64-static",
    ),
    Target(
        "riscv64",
        "riscv64-unknown-linux-gnu",
        "generic-rv64",
        "+m,+a,+f,+d,+c,+zicsr",
        "lp64d",
        compiler="riscv64-linux-gnu-gcc",
        package="gcc-riscv64-linux-gnu libc6-dev-riscv64-cross",
        emulator="qemu-riscv64-static",
    ),
    Target(
        "armv7",
        "armv7-unknown-linux-gnueabihf",
        "generic",
        "+v7,+vfp3d16,+thumb2",
        compiler="arm-linux-gnueabihf-gcc",
        package="gcc-arm-linux-gnueabihf libc6-dev-armhf-cross",
        emulator="qemu-arm-static",
    ),
    Target(
        "cortex-m7",
        "thumbv7em-unknown-none-eabihf",
        "cortex-m7",
        "+fp64",
        compiler="arm-none-eabi-gcc",
        flags=("-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-d16"),
        package=_BARE,
        emulator="qemu-system-arm",
        machine="mps2-an500",
        emulator_package="qemu-system-arm",
    ),
    Target(
        "cortex-m4",
        "thumbv7em-unknown-none-eabi",
        "cortex-m4",
        "+soft-float",
        compiler="arm-none-eabi-gcc",
        flags=("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=soft"),
        package=_BARE,
        emulator="qemu-system-arm",
        machine="mps2-an386",
        emulator_package="qemu-system-arm",
    ),
    Target(
        "leon3",
        "sparc-unknown-elf",
        "leon3",
        compiler="sparc64-linux-gnu-gcc",
        flags=("-m32", "-mcpu=leon3"),
        package="gcc-sparc64-linux-gnu gcc-multilib-sparc64-linux-gnu libc6-dev-sparc-sparc64-cross",
        emulator="qemu-sparc32plus-static",
        big_endian=True,
    ),
)
TARGETS = {target.name: target for target in _TARGETS}
HOST = "x86_64"


def target_of(text: str) -> Target:
    """The target of a name, or of TRIPLE or TRIPLE:PROCESSOR, of which nothing but objects can be made.

    Raises:
        ExportError: there is none of that name.
    """
    if text in TARGETS:
        return TARGETS[text]
    triple, _, processor = text.partition(":")
    if triple.count("-") >= 2:
        return Target(text.replace(":", "_"), triple, processor, runs=False)
    right = f"expected one of {', '.join(TARGETS)}, or TRIPLE or TRIPLE:PROCESSOR as LLVM has them"
    raise ExportError(f"--target {unknown_name(text, TARGETS)}; {right}")
