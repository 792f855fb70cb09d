# SPDX-License-Identifier: Apache-2.0
"""A library in the place of the compiled function of a component: the processor in the loop, or somebody's own code.

A program such as `sunpoint_NAME_main` is spoken to through pipes, in an emulator where it is another processor's; a
shared library likewise, by a process that loads it, so that its faults end that alone. Both get the structs of
`sunpoint_NAME.h` and are asked for those back: what gives the structs of that header flies, whoever wrote it.
"""

import contextlib
import hashlib
import os
import platform
import select
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np

from css_common.component import Component
from css_common.component_error import ComponentError
from css_common.mission_node import Node
from css_export.c_main import LAYOUT, PARAMETERS, STATE, STEP, word
from css_export.entry import Interface, interface_of
from css_export.errors import ExportError
from css_export.flown import INPUT, MEMORY, OUTPUT, Function, fresh, functions_of
from css_export.flown import PARAMETERS as PARAMETERS_ROLE
from css_export.flown import STATE as STATE_ROLE
from css_export.layout import Struct, layout_number, pack, unpack
from css_export.names import prefix_of
from css_export.recorded_calls import attach
from css_export.targets import TARGETS

_ELF_PROGRAM, _ELF_SHARED = 2, 3
_BIG_ENDIAN = b"\2"
_unnamed: set[Path] = set()  # of which it has been said that they have no number of their structs
_HERE = platform.machine()
_PATIENCE_S = 30.0  # for an answer; a flight waits as long for a partner unless its mission says otherwise
_GRACE_S = 2.0  # of a program to which nothing more can come
_MACHINES = {62: "x86_64", 183: "aarch64", 243: "riscv64", 40: "armv7"}


class _NoAnswer(Exception):
    """It did not answer in time."""


class Processor:
    """A program, or a shared library in a process of its own, spoken to through pipes; it keeps the state itself."""

    def __init__(self, file: Path, prefix: str, structs: dict[str, Struct]) -> None:
        """Starts it.

        Raises:
            ExportError: it cannot be started, or was made for other structs.
        """
        self._file = file
        self._silent = ""  # why it was ended
        roles = (PARAMETERS_ROLE, STATE_ROLE, INPUT, OUTPUT)
        sizes = [structs[role].size for role in roles]
        try:
            self._process = subprocess.Popen(
                _command(file, prefix, sizes),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                start_new_session=True,  # an interrupt is for the flight, which then closes the pipe
            )
        except OSError as error:
            raise ExportError(f"{file}: {error.strerror}") from error
        self._sizes = [structs[OUTPUT].size, 8, structs[STATE_ROLE].size]
        self._state: bytes | None = None
        self._parameters: bytes | None = None
        try:
            (number,) = self._answers(word(LAYOUT), [8])
        except ComponentError as error:
            raise ExportError(f"{error}, asked for the number of its structs") from error
        self._refuse_other(prefix, int.from_bytes(number, "little"), layout_number(structs))

    def _refuse_other(self, prefix: str, number: int, expected: int) -> None:
        if number == 0 and self._file not in _unnamed:
            _unnamed.add(self._file)
            print(
                f"{self._file}: has no {prefix}_layout, so that nobody knows for which structs it was made; taken for "
                "those of this mission",
                file=sys.stderr,
            )
        if number not in (0, expected):
            raise ExportError(
                f"{self._file}: made for other structs ({prefix}_layout is {number:#018x}, of this mission "
                f"{expected:#018x}); expected one made with the header that `export` writes for this mission"
            )

    def step(self, parameters: bytes, state: bytes, inputs: bytes) -> tuple[bytes, bytes]:
        """State after a step and its outputs.

        Raises:
            ComponentError: it ended.
        """
        asked = b""
        if parameters != self._parameters:
            asked += word(PARAMETERS) + parameters
            self._parameters = parameters
        if state != self._state:
            asked += word(STATE) + state
        output, _, self._state = self._answers(asked + word(STEP) + inputs, self._sizes)
        return self._state, output

    def _answers(self, asked: bytes, sizes: list[int]) -> list[bytes]:
        pipe_in, pipe_out = self._process.stdin, self._process.stdout
        assert pipe_in is not None and pipe_out is not None
        given = b""
        try:
            pipe_in.write(asked)
            pipe_in.flush()
            given = self._read(pipe_out.fileno(), sum(sizes))
        except (OSError, ValueError):
            pass  # closed by the other side, or by this one since that ended
        except _NoAnswer as error:
            self._process.kill()
            self.close()
            self._silent = str(error)
        if self._silent:
            raise ComponentError(f"{self._file}: {self._silent}")
        if len(given) != sum(sizes):
            raise ComponentError(f"{self._file}: {self._end()}")
        ends = [sum(sizes[: k + 1]) for k in range(len(sizes))]
        return [given[end - size : end] for end, size in zip(ends, sizes, strict=True)]

    def _read(self, pipe: int, size: int) -> bytes:
        """So many bytes, or what comes until the other side closes."""
        poll, until, given = select.poll(), time.monotonic() + _PATIENCE_S, bytearray()
        poll.register(pipe, select.POLLIN)
        while len(given) < size:
            if not poll.poll(1000.0 * max(0.0, until - time.monotonic())):
                raise _NoAnswer(f"no answer within {_PATIENCE_S:g} s: ended")
            data = os.read(pipe, size - len(given))
            if not data:
                break
            given += data
        return bytes(given)

    def _end(self) -> str:
        self.close()
        code = self._process.returncode
        return f"ended by {signal.Signals(-code).name}" if code < 0 else f"ended with {code}"

    def close(self) -> None:
        """Ends the program, which it does when nothing more can come, or is ended if it does not."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()
        try:
            self._process.wait(_GRACE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def __del__(self) -> None:
        if hasattr(self, "_process"):
            self.close()


def _command(file: Path, prefix: str, sizes: list[int]) -> list[str]:
    """What runs a file.

    Raises:
        ExportError: nothing here does.
    """
    name = _MACHINES.get(_elf(file)[1], "")
    if _is_library(file):
        if name != _HERE:
            raise ExportError(
                f"{file}: a shared library of {name or 'another processor'}, this machine is {_HERE}; a program for it "
                "(sunpoint_NAME_main, of `make TARGET=...`) flies in an emulator"
            )
        server = [sys.executable, "-m", "css_export.library_server", str(file.absolute()), prefix]
        return [*server, *map(str, sizes)]
    target = TARGETS.get(name)
    if target is None:
        raise ExportError(f"{file}: of a processor for which no emulator is known")
    if target.emulator and shutil.which(target.emulator) is None:
        raise ExportError(f"{file}: {target.emulator} is not installed: apt-get install {target.emulator_package}")
    return [*([target.emulator] if target.emulator else []), str(file.absolute()), "state"]


def _is_library(file: Path) -> bool:
    # a program that may lie anywhere is a shared object, too
    return _elf(file)[0] == _ELF_SHARED and file.suffix == ".so"


def _elf(file: Path) -> tuple[int, int]:
    """Kind and processor of a program or library.

    Raises:
        ExportError: it is neither.
    """
    head = file.read_bytes()[:20]
    if head[:4] == b"\x7fELF" and head[5:6] == _BIG_ENDIAN:
        raise ExportError(f"{file}: of a processor with the most significant byte first: it cannot fly here")
    kind, machine = (int.from_bytes(head[at : at + 2], "little") for at in (16, 18))
    if head[:4] != b"\x7fELF" or kind not in (_ELF_PROGRAM, _ELF_SHARED):
        raise ExportError(f"{file}: expected a shared library or a program")
    return kind, machine


def refuse_without_step(file: Path, prefix: str) -> None:
    """Refuses a shared library that cannot be loaded, or lacks the step.

    It is loaded in a process of its own: loading runs what is in it.

    Raises:
        ExportError: saying why.
    """
    text = "import ctypes, sys\ntry:\n    getattr(ctypes.CDLL(sys.argv[1]), sys.argv[2])\n"
    text += "except (OSError, AttributeError) as error:\n    sys.exit(str(error))\n"
    asked = [sys.executable, "-c", text, str(file.absolute()), f"{prefix}_step"]
    try:
        done = subprocess.run(asked, capture_output=True, check=False, timeout=_PATIENCE_S)
    except subprocess.TimeoutExpired as error:
        raise ExportError(f"{file}: loading it has not ended within {_PATIENCE_S:g} s") from error
    if done.returncode != 0:
        said = done.stderr.decode(errors="replace").strip().splitlines()
        raise ExportError(f"{file}: {said[-1] if said else f'loading it ended with {done.returncode}'}")


def stand_in(node: Node, file: str) -> type[Component]:
    """A component that does the same as a node's, but for its compiled function, which a library is asked for.

    Args:
        node: whose component it is.
        file: a shared library, or a program that speaks as `sunpoint_NAME_main` does.

    Raises:
        ExportError: there is no such file, or the component has not one compiled function alone.
    """
    functions = list(functions_of(node))
    if len(functions) != 1:
        what = "no compiled function" if not functions else "several compiled functions"
        raise ExportError(f"--component {node.name}: it has {what}, a library takes the place of one")
    (function,) = functions
    path = Path(file)
    if not path.is_file():
        raise ExportError(f"--component {node.name}: {file}: no such file")
    prefix = prefix_of(function.name)
    _command(path, prefix, [])
    if _is_library(path):
        refuse_without_step(path, prefix)
    # asked here for the number of its structs, before anything starts
    library_step(function, function.kernel, path)

    def around(kernel: Callable[..., Any]) -> Callable[..., Any]:
        return library_step(function, kernel, path)

    class StandIn(node.component):  # type: ignore[name-defined]
        """A component with a library in it."""

        made_of = {"file": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}  # noqa: RUF012

        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            attach(self, function.attribute, around)

        def cycle_through(self, steps: Any) -> None:
            return None

    StandIn.__name__, StandIn.__module__ = node.component.__name__, node.component.__module__
    StandIn.__doc__ = node.component.__doc__
    return StandIn


def library_step(function: Function, kernel: Callable[..., Any], file: Path) -> Callable[..., Any]:
    """What a component calls in the place of its kernel: a library that is asked for each step.

    Raises:
        ExportError: the file is no library or program, cannot be loaded or started, or lacks the step.
    """
    return _Step(function, kernel, file)


class _Step:
    """What a component calls in the place of its kernel."""

    def __init__(self, function: Function, kernel: Callable[..., Any], file: Path) -> None:
        arguments = fresh(function)
        result = kernel(*arguments)
        output = result[1] if function.keeps_state else result
        self._function, self._like = function, output
        self._interface: Interface = interface_of(function, numba.typeof(output))
        self._processor = Processor(file, prefix_of(function.name), self._interface.structs)

    def _packed(self, role: str, arguments: tuple[Any, ...]) -> bytearray:
        function, struct_ = self._function, self._interface.structs[role]
        roles = (STATE_ROLE, MEMORY) if role == STATE_ROLE else (role,)
        values = tuple(v for v, r in zip(arguments, function.roles, strict=True) if r in roles)
        return pack(struct_, values[0] if role == PARAMETERS_ROLE else values)

    def __call__(self, *arguments: Any) -> Any:
        function, structs = self._function, self._interface.structs
        given = [bytes(self._packed(role, arguments)) for role in (PARAMETERS_ROLE, STATE_ROLE, INPUT)]
        state, output = self._processor.step(*given)
        for i, role in enumerate(function.roles):
            if role in (MEMORY, OUTPUT):
                struct_role, place = self._interface.fields[i]
                field = structs[struct_role].fields[place]
                _fill(field.layout, arguments[i], state if role == MEMORY else output, field.offset)
        result = self._result(output)
        if not function.keeps_state:
            return result
        (at,) = function.places(STATE_ROLE)
        field = structs[STATE_ROLE].fields[self._interface.fields[at][1]]
        return unpack(field.layout, function.sample[at], state, field.offset), result

    def _result(self, output: bytes) -> Any:
        struct_ = self._interface.structs[OUTPUT]
        fields = struct_.fields[len(self._function.places(OUTPUT)) :]
        if not hasattr(self._like, "_fields"):
            return unpack(fields[0].layout, self._like, output, fields[0].offset)
        parts = [unpack(f.layout, like, output, f.offset) for f, like in zip(fields, self._like, strict=True)]
        return type(self._like)(*parts)


def _fill(layout: Any, into: Any, data: bytes, at: int) -> None:
    """Writes into the arrays of a memory what stands in a struct."""
    if isinstance(into, np.ndarray):
        into[...] = np.frombuffer(data, into.dtype, into.size, at).reshape(into.shape)
    elif isinstance(into, tuple):
        assert isinstance(layout, Struct)
        for field, part in zip(layout.fields, into, strict=True):
            _fill(field.layout, part, data, at + field.offset)
