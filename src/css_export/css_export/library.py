# SPDX-License-Identifier: Apache-2.0
"""One kernel as a C library: its interface, its sources, its objects."""

import hashlib
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import llvmlite
import numba

from css_common.mission import Mission
from css_common.whole_files import write_whole
from css_export.archive import archive
from css_export.c_main import main_text
from css_export.data_text import constant_text, init_text, limits_text, step_text, version_text
from css_export.elf import Contents, contents
from css_export.entry import Compiled, Interface, Native, compile_function
from css_export.flown import MEMORY, PARAMETERS, STATE, Function
from css_export.header import header_text
from css_export.layout import layout_number, pack
from css_export.limits import Limit, limits_of, whole_numbers
from css_export.machine_code import Built, built
from css_export.names import prefix_of
from css_export.operations import NOT_ASKED, Bound, bound_of
from css_export.shipped_mathematics import EXACT, NAME, notice, with_mathematics
from css_export.targets import Target

_RELEASED = "css_estimation"  # whose version is that of Sunpoint
TARGET, MUSL = "target", "musl"
WHOSE = {TARGET: "of the C library that it is linked with", MUSL: f"of {NAME}"}


@dataclass(frozen=True)
class MachineCode:
    """A library for a target.

    Attributes:
        stack: [bytes] of the step, without that of the functions that are linked.
        bound: operations of the step at most.
        text: the intermediate code that it was made of, optimised.
    """

    target: Target
    object: bytes
    archive: bytes
    contents: Contents
    stack: int
    bound: Bound = NOT_ASKED
    text: str = ""


@dataclass(frozen=True)
class Library:
    """A kernel behind a C interface.

    Attributes:
        prefix: of all its symbols.
        version: of Sunpoint, of the compilers, and the hash of the mission.
        limits: of its parameters.
        texts: its modules of intermediate code.
        native: the kernel behind the same interface, as numba compiles it for this machine.
        mathematics: TARGET or MUSL: whose functions it calls.
    """

    function: Function
    prefix: str
    version: str
    interface: Interface
    limits: list[Limit]
    texts: tuple[str, ...]
    native: Native
    mathematics: str = TARGET

    @property
    def exported(self) -> tuple[str, ...]:
        """Symbols that others may link."""
        names = ("step", "init", "check", "mission", "limits", "version", "layout")
        return tuple(f"{self.prefix}_{name}" for name in names)

    def for_target(self, target: Target) -> MachineCode:
        """Its machine code.

        Raises:
            ExportError: something in it must not fly, or there is no code for such a target.
        """
        made = self._built(target)
        step = f"{self.prefix}_step"
        packed = archive({"step.o": made.object})
        bound = bound_of(made.text, step, self._whole_numbers())
        return MachineCode(target, made.object, packed, contents(made.object), made.stacks[step], bound, made.text)

    def _whole_numbers(self) -> list[tuple[int, int, int]]:
        struct_ = self.interface.structs[PARAMETERS]
        p = self.function.sample[self.function.places(PARAMETERS)[0]]
        return list(whole_numbers(self.limits, pack(struct_, p)))

    def _built(self, target: Target) -> Built:
        if self.mathematics == TARGET:
            return built(self.function.name, self.texts, self.exported, target)
        also: set[str] = set()
        while True:
            texts = with_mathematics(self.texts, also)
            made = built(self.function.name, texts, self.exported, target)
            more = set(contents(made.object).missing) & EXACT - also
            if not more:
                return made
            also |= more

    def header(self) -> str:
        """`sunpoint_NAME.h`."""
        return header_text(self.function, self.interface, self.prefix, self.version, len(self.limits))

    def main(self) -> str:
        """`sunpoint_NAME_main.c`."""
        return main_text(self.prefix, self.interface.structs[STATE].size)


def state_values(function: Function, arguments: tuple[Any, ...]) -> tuple[Any, ...]:
    """What of a kernel's arguments is carried on, in the order of the struct of the state."""
    return tuple(value for value, role in zip(arguments, function.roles, strict=True) if role in (STATE, MEMORY))


def made_library(mission: Mission, function: Function, mathematics: str = TARGET) -> Library:
    """Compiles a kernel of a mission.

    Args:
        mission: that it flies in.
        function: the kernel.
        mathematics: TARGET: sine and others are the C library's that the image is linked with; MUSL: they are in it.

    Raises:
        ExportError: it cannot be exported.
    """
    compiled: Compiled = compile_function(function)
    interface, prefix = compiled.interface, prefix_of(function.name)
    version = version_of(mission, function, mathematics)
    structs = interface.structs
    p = function.sample[function.places(PARAMETERS)[0]]
    limits = limits_of(structs[PARAMETERS], p, function.values)
    texts = (
        compiled.text,
        step_text(prefix, compiled.symbol),
        init_text(prefix, structs[STATE], state_values(function, function.sample)),
        constant_text(f"{prefix}_mission", structs[PARAMETERS], pack(structs[PARAMETERS], p)),
        limits_text(prefix, limits),
        version_text(prefix, version),
        f"@{prefix}_layout = constant i64 {layout_number(structs)}\n",
    )
    return Library(function, prefix, version, interface, limits, texts, compiled.native, mathematics)


def version_of(mission: Mission, function: Function, mathematics: str) -> str:
    """What a library says of itself: what it was made of and by."""
    digest = hashlib.sha256(mission.text().encode()).hexdigest()
    return (
        f"Sunpoint {_release()}, {function.component} of mission {mission.name}, sha256 of the mission {digest}, "
        f"numba {numba.__version__}, llvmlite {llvmlite.__version__}, mathematics {WHOSE[mathematics]}"
    )


def _release() -> str:
    try:
        return metadata.version(_RELEASED)
    except metadata.PackageNotFoundError:
        return "(not installed)"


def write_library(library: Library, codes: list[MachineCode], folder: Path) -> list[Path]:
    """Writes sources and objects of a library into a folder; which files.

    What was linked with objects that lay there before is removed.

    Raises:
        OSError: they cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = {
        folder / f"{library.prefix}.h": library.header().encode(),
        folder / f"{library.prefix}_main.c": library.main().encode(),
    }
    if library.mathematics == MUSL:
        files[folder / "COPYRIGHT.musl"] = notice().encode()
    for code in codes:
        place = folder / code.target.name
        place.mkdir(exist_ok=True)
        files[place / f"{library.prefix}.o"] = code.object
        files[place / f"lib{library.prefix}.a"] = code.archive
        for linked in (f"lib{library.prefix}.so", f"{library.prefix}_main"):
            (place / linked).unlink(missing_ok=True)
    for file, data in files.items():
        write_whole(file, data)
    return list(files)
