# SPDX-License-Identifier: Apache-2.0
"""A library in the place of the compiled function of a component: the processor in the loop, or somebody's own code.

A shared library is called in this process. A program such as `sunpoint_NAME_main` is spoken to through pipes, in an
emulator where it is another processor's. Both get the structs of `sunpoint_NAME.h` and are asked for those back: what
gives the structs of that header flies, whoever wrote it.
"""

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numba
import numpy as np

from css_common.component import Component
from css_common.mission import Node
from css_export.c_main import BEGIN, PARAMETERS, STEP, word
from css_export.entry import Interface, interface_of
from css_export.errors import ExportError
from css_export.flown import INPUT, MEMORY, OUTPUT, Function, fresh, functions_of
from css_export.flown import PARAMETERS as PARAMETERS_ROLE
from css_export.flown import STATE as STATE_ROLE
from css_export.layout import Struct, pack, unpack
from css_export.names import prefix_of
from css_export.recorded_calls import attach
from css_export.targets import TARGETS

_ELF_PROGRAM, _ELF_SHARED = 2, 3
_MACHINES = {62: "x86_64", 183: "aarch64", 243: "riscv64", 40: "armv7"}


class Processor(Protocol):
    """What makes steps: bytes of structs in, bytes of structs out."""

    def step(self, parameters: bytes, state: bytes, inputs: bytes) -> tuple[bytes, bytes]:
        """State after a step and its outputs."""


class SharedLibrary:
    """Called in this process."""

    def __init__(self, file: Path, prefix: str, structs: dict[str, Struct]) -> None:
        """Loads a shared library.

        Raises:
            ExportError: it cannot be loaded, or lacks the step.
        """
        self._step = loaded_step(file, prefix)
        self._outputs = structs[OUTPUT].size

    def step(self, parameters: bytes, state: bytes, inputs: bytes) -> tuple[bytes, bytes]:
        """State after a step and its outputs."""
        places = [_place(data) for data in (parameters, state, inputs, bytes(self._outputs))]
        self._step(*(ctypes.c_void_p(place.ctypes.data) for place in places))
        return places[1].tobytes(), places[3].tobytes()


def loaded_step(file: Path, prefix: str) -> Any:
    """The step of a shared library.

    Raises:
        ExportError: it cannot be loaded, or lacks it.
    """
    try:
        step = getattr(ctypes.CDLL(str(file.absolute())), f"{prefix}_step")
    except (OSError, AttributeError) as error:
        raise ExportError(f"{file}: {error}") from error
    step.restype = None
    return step


def _place(data: bytes) -> np.ndarray:
    """A copy that begins where any struct may."""
    place = np.zeros(len(data) // 8 + 1, np.uint64).view(np.uint8)[: len(data)]
    place[:] = np.frombuffer(data, np.uint8)
    return place


class Program:
    """Spoken to through pipes; it keeps the state itself."""

    def __init__(self, file: Path, structs: dict[str, Struct], fresh_state: bytes) -> None:
        """Starts a program.

        Raises:
            ExportError: it cannot be started.
        """
        head = file.read_bytes()[:20]
        target = TARGETS.get(_MACHINES.get(int.from_bytes(head[18:20], "little"), ""))
        if target is None:
            raise ExportError(f"{file}: of a processor for which no emulator is known")
        if target.emulator and shutil.which(target.emulator) is None:
            raise ExportError(f"{file}: {target.emulator} is not installed: apt-get install qemu-user-static")
        command = [*([target.emulator] if target.emulator else []), str(file.absolute()), "state"]
        try:
            self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        except OSError as error:
            raise ExportError(f"{file}: {error.strerror}") from error
        self._sizes = [structs[OUTPUT].size, 8, structs[STATE_ROLE].size]
        self._fresh = self._state = fresh_state
        self._parameters = b""
        self._file = file

    def step(self, parameters: bytes, state: bytes, inputs: bytes) -> tuple[bytes, bytes]:
        """State after a step and its outputs.

        Raises:
            ExportError: the program ended, or is to go on from a state that it does not have.
        """
        asked = b""
        if state != self._state:
            if state != self._fresh:
                raise ExportError(f"{self._file}: it cannot be given a state")
            asked += word(BEGIN)
        if parameters != self._parameters:
            asked += word(PARAMETERS) + parameters
            self._parameters = parameters
        pipe_in, pipe_out = self._process.stdin, self._process.stdout
        assert pipe_in is not None and pipe_out is not None
        try:
            pipe_in.write(asked + word(STEP) + inputs)
            pipe_in.flush()
        except OSError as error:
            raise ExportError(f"{self._file}: it ended") from error
        output, _, self._state = (pipe_out.read(size) for size in self._sizes)
        if len(self._state) != self._sizes[2]:
            raise ExportError(f"{self._file}: it ended")
        return self._state, output

    def close(self) -> None:
        """Ends the program, which it does when nothing more can come."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        self._process.wait()

    def __del__(self) -> None:
        if hasattr(self, "_process"):
            self.close()


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
    _elf_kind(path)
    if path.suffix == ".so":
        loaded_step(path, prefix_of(function.name))

    def around(kernel: Callable[..., Any]) -> Callable[..., Any]:
        return library_step(function, kernel, path)

    class StandIn(node.component):  # type: ignore[name-defined]
        """A component with a library in it."""

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
    return _Step(function, kernel, file, _elf_kind(file))


def _elf_kind(file: Path) -> int:
    head = file.read_bytes()[:20]
    kind = int.from_bytes(head[16:18], "little") if head[:4] == b"\x7fELF" else 0
    if kind not in (_ELF_PROGRAM, _ELF_SHARED):
        raise ExportError(f"{file}: expected a shared library or a program")
    return kind


class _Step:
    """What a component calls in the place of its kernel."""

    def __init__(self, function: Function, kernel: Callable[..., Any], file: Path, kind: int) -> None:
        arguments = fresh(function)
        result = kernel(*arguments)
        output = result[1] if function.keeps_state else result
        self._function, self._like = function, output
        self._interface: Interface = interface_of(function, numba.typeof(output))
        structs = self._interface.structs
        is_program = kind == _ELF_PROGRAM or file.suffix != ".so"
        self._processor: Processor = (
            Program(file, structs, bytes(self._packed(STATE_ROLE, function.sample)))
            if is_program
            else SharedLibrary(file, prefix_of(function.name), structs)
        )

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
