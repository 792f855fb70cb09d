# SPDX-License-Identifier: Apache-2.0
"""Compiling and running the exported C here: for the processor of this machine, and for others in an emulator."""

import shutil
import subprocess
from pathlib import Path

from css_export.bare_metal import image_command, run_image
from css_export.errors import ToolError
from css_export.targets import Target

WARNINGS = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror")
_LONGEST_S = 3600


def why_not(target: Target) -> str | None:
    """Why a program for a target cannot be run here, with the command that would change it; None: it can."""
    if not target.runs:
        return "no emulator of a whole program is known for it: objects alone"
    missing = [
        package
        for tool, package in ((target.compiler, target.package), (target.emulator, target.emulator_package))
        if tool and shutil.which(tool) is None
    ]
    return f"not installed: apt-get install {' '.join(missing)}" if missing else None


def can_link(target: Target) -> bool:
    """Whether a compiler for the target is here."""
    return bool(target.compiler) and shutil.which(target.compiler) is not None


def compiled_program(
    target: Target, sources: list[Path], libraries: list[Path], program: Path, counted: str = ""
) -> Path:
    """Compiles and links a program, warnings as errors; another processor's with its C library inside.

    Args:
        target: the processor.
        sources: in C.
        libraries: archives.
        program: where it goes.
        counted: symbol of a function whose instructions are to be counted, where the emulator can do that.

    Raises:
        ToolError: the compiler is missing or refuses it.
    """
    static = ["-static"] if target.emulator else []
    if target.machine:
        objects = []
        for source in sources:
            objects.append(compiled_object(target, source, program.with_name(f"{source.stem}.o")))
        beside = image_command(program, counted)
        _run(
            [target.compiler, "-O1", *target.flags, *beside, "-o", str(program), *map(str, objects + libraries), "-lm"]
        )
        return program
    files = [*map(str, sources), *map(str, libraries)]
    command = [target.compiler, *WARNINGS, "-O1", *target.flags, *static, "-o", str(program), *files, "-lm"]
    _run(command)
    return program


def shared_library(target: Target, source: Path, file: Path) -> Path:
    """Makes a shared library of an archive or of a source file, as `fly --component` loads it.

    Raises:
        ToolError: the compiler is missing or refuses it.
    """
    whole = ["-Wl,--whole-archive", str(source), "-Wl,--no-whole-archive"]
    _run([target.compiler, *WARNINGS, *target.flags, "-shared", "-fPIC", "-o", str(file), *whole, "-lm"])
    return file


def compiled_object(target: Target, source: Path, file: Path, *, cplusplus: bool = False) -> Path:
    """Compiles one file, warnings as errors.

    Raises:
        ToolError: the compiler is missing or refuses it.
    """
    flags = ["-x", "c++", "-std=c++11", *WARNINGS[1:]] if cplusplus else list(WARNINGS)
    _run([target.compiler, *target.flags, *flags, "-c", "-o", str(file), str(source)])
    return file


def _run(command: list[str]) -> None:
    try:
        done = subprocess.run(command, capture_output=True, check=False)
    except OSError as error:
        raise ToolError(f"{command[0]}: {error.strerror}") from error
    if done.returncode != 0:
        said = done.stderr.decode(errors="replace").strip().splitlines() or [f"ended with {done.returncode}"]
        reasons = [line for line in said if "error" in line or "undefined" in line]
        raise ToolError(f"{command[0]}: {(reasons or said)[0]}")


def run_program(target: Target, program: Path, stream: bytes) -> bytes:
    """What a program writes for what it is given.

    Raises:
        ToolError: it failed.
    """
    return counted_run(target, program, stream)[0]


def counted_run(target: Target, program: Path, stream: bytes) -> tuple[bytes, int | None]:
    """What a program writes, and instructions of the longest call that it counts; None where none are counted.

    Raises:
        ToolError: it failed.
    """
    if target.machine:
        return run_image(target, program, stream)
    command = [*([target.emulator] if target.emulator else []), str(program)]
    try:
        done = subprocess.run(command, input=stream, capture_output=True, check=False, timeout=_LONGEST_S)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ToolError(f"{' '.join(command)}: {error}") from error
    if done.returncode != 0:
        said = done.stderr.decode(errors="replace").strip()
        raise ToolError(f"{' '.join(command)}: ended with {done.returncode}: {said}")
    return done.stdout, None
