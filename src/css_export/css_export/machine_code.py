# SPDX-License-Identifier: Apache-2.0
"""From intermediate code to machine code for a target: the functions with C's calling convention, and data beside them.

What must not fly is refused here by name: symbols of Python or of numba, counting of references, allocation, and the
traces that an exception would leave.
"""

import json
import pickle
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm

from css_export.data_text import NEVER
from css_export.errors import ExportError
from css_export.targets import Target

_FORBIDDEN = re.compile(r"^(numba_|NRT_|_?Py[A-Z_]|_?Z?numba|nrt_)")
_ALLOCATION = {"malloc", "calloc", "realloc", "free", "aligned_alloc", "posix_memalign", "_Znwm", "_ZdlPv"}
# what numba leaves of an exception: its pickled arguments
_EXCEPTION = "picklebuf"
_PICKLED = re.compile(r'^@\.const\.pickledata\.[0-9a-f]+(?:\.\d+)? = .*? c"(.*)"', re.MULTILINE)
_DECLARED = re.compile(r"^declare .*?@(\"[^\"]+\"|[\w.$]+)\(", re.MULTILINE)
_HOST_ATTRIBUTES = re.compile(r'"(?:target-cpu|target-features|tune-cpu)"="[^"]*"')
_DEFINITION = re.compile(r"^(define .*?) \{$", re.MULTILINE)
_TELL_STACK = ' "warn-stack-size"="0"'
_CALLED = re.compile(r"(?:call|invoke) .*?@(\"[^\"]+\"|[\w.$]+)\(")
# or what stands between quotes, to be passed over: a string may end in what looks like the sign of a name
_LONG_NAME = re.compile(r'(%)("[^"]{200,}"|[\w.$-]{200,})()|"[^"]*"')
_LONG_LABEL = re.compile(r"""^()("[^"]{200,}"|[\w.$-]{200,})(:)""", re.MULTILINE)
_UNKNOWN = re.compile(r"'([^']*)' is not a recognized (processor|feature)")
_WARNED = re.compile(r"stack frame size \((\d+)\) exceeds limit \(\d+\) in function '([^']+)'")


@dataclass(frozen=True)
class Built:
    """Machine code of a function for a target.

    Attributes:
        object: an ELF file.
        stacks: [bytes] that each function of it needs with those of it that it calls, without what is linked.
        text: the intermediate code that it was made of, optimised.
    """

    object: bytes
    stacks: dict[str, int]
    text: str


def built(name: str, texts: Iterable[str], exported: Iterable[str], target: Target) -> Built:
    """Compiles modules of intermediate code into one object, in a process of its own.

    LLVM ends its process over a processor that it cannot make code for, and tells sizes of stacks to standard error.

    Args:
        name: for errors.
        texts: the modules.
        exported: symbols that others may see.
        target: the processor.

    Raises:
        ExportError: something in it must not fly, or LLVM does not know the target.
    """
    asked = json.dumps({"name": name, "texts": list(texts), "exported": list(exported), "target": target})
    done = subprocess.run([sys.executable, "-m", __name__], input=asked.encode(), capture_output=True, check=False)
    said = done.stderr.decode(errors="replace")
    if done.returncode != 0:
        lines = [line for line in said.splitlines() if line.strip(" ^~")]
        reason = next((line for line in lines if "error:" in line), lines[-1] if lines else "")
        reason = reason or f"LLVM ended with {done.returncode}"
        raise ExportError(f"{name} for {target.name}: {reason}")
    unknown = _UNKNOWN.search(said)
    if unknown:
        # LLVM would go on with the least that has the triple, without its floating point
        raise ExportError(
            f"--target {target.triple}:{target.processor}: {unknown[2]} {unknown[1]} is unknown; expected one that "
            f"LLVM has for {target.triple.partition('-')[0]}, as `clang --target={target.triple} -mcpu=help` lists them"
        )
    answer = json.loads(done.stdout)
    if "refused" in answer:
        raise ExportError(answer["refused"])
    frames = {function: int(size) for size, function in _WARNED.findall(said)}
    return Built(bytes.fromhex(answer["object"]), _stacks(frames, answer["calls"]), answer["text"])


def _stacks(frames: Mapping[str, int], calls: Mapping[str, list[str]]) -> dict[str, int]:
    def need(function: str, above: tuple[str, ...]) -> int:
        if function in above:
            raise ExportError(f"{function} calls itself: its stack has no bound")
        deepest = max((need(other, (*above, function)) for other in calls[function] if other in calls), default=0)
        return frames.get(function, 0) + deepest

    return {function: need(function, ()) for function in calls}


def _emitted(asked: dict[str, Any]) -> dict[str, Any]:
    target = Target(*asked["target"])
    machine = _machine(target)
    module = _linked(asked["texts"], target, machine)
    _hide(module, set(asked["exported"]))
    _optimise(module, machine)
    text = str(module)
    if NEVER in text:
        # that there is no way to an exception may show only once the code is simple
        _optimise(module, machine)
        text = str(module)
    refuse(asked["name"], text, asked["texts"])
    told = llvm.parse_assembly(_with_short_names(_DEFINITION.sub(rf"\1{_TELL_STACK} {{", text), "sunpoint.2"))
    told.verify()
    calls = {
        function.name: sorted({found.strip('"') for found in _CALLED.findall(str(function))})
        for function in told.functions
        if not function.is_declaration
    }
    # before machine code is made of it, which changes it; whoever runs it is not to be told of its stack
    text = str(told).replace(_TELL_STACK, "")
    return {"object": machine.emit_object(told).hex(), "calls": calls, "text": text}


def refuse(name: str, text: str, before: Iterable[str] = ()) -> None:
    """Refuses intermediate code that holds what must not fly.

    Args:
        name: for errors.
        text: the code.
        before: the same before it was optimised, which still names the exceptions.

    Raises:
        ExportError: naming it.
    """
    declared = {found.strip('"') for found in _DECLARED.findall(text)}
    bad = sorted(symbol for symbol in declared if _FORBIDDEN.match(symbol))
    if bad:
        raise ExportError(f"{name}: needs {', '.join(bad)}, of Python or numba; a kernel that flies has none of it")
    bad = sorted(declared & _ALLOCATION)
    if bad:
        raise ExportError(f"{name}: allocates memory ({', '.join(bad)}); a kernel that flies has room given to it")
    if NEVER in declared or _EXCEPTION in text:
        found = set(_exceptions(text)) or {kind for module in before for kind in _exceptions(module)}
        told = " or ".join(sorted(found)) or "an exception"
        raise ExportError(f"{name}: can raise {told}, for which nobody waits in flight")


def _exceptions(text: str) -> Iterator[str]:
    """The exceptions whose pickled arguments numba left in a module, each with the function that raises it."""
    for found in _PICKLED.findall(text):
        raw = re.sub(rb"\\([0-9A-Fa-f]{2})", lambda code: bytes([int(code[1], 16)]), found.encode())
        try:
            kind, arguments, place = pickle.loads(raw)  # what this process has compiled
        except (pickle.UnpicklingError, ValueError, TypeError, EOFError):
            continue
        said = f" ({arguments[0]})" if arguments else ""
        where = f" in {place[0]}, {Path(place[1]).name} line {place[2]}" if place else ""
        yield f"{kind.__name__}{said}{where}"


def _machine(target: Target) -> llvm.TargetMachine:
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    try:
        known = llvm.Target.from_triple(target.triple)
        return known.create_target_machine(
            cpu=target.processor,
            features=target.features,
            opt=2,
            reloc="pic" if target.name == "x86_64" else "static",
            codemodel="default",
            abiname=target.abi,
        )
    except RuntimeError as error:
        raise ExportError(f"target {target.name}: {error}") from error


def _linked(texts: Iterable[str], target: Target, machine: llvm.TargetMachine) -> llvm.ModuleRef:
    modules = []
    for text in texts:
        text = _with_short_names(_HOST_ATTRIBUTES.sub("", text), "sunpoint.1")
        text = re.sub(r'^target (triple|datalayout) = ".*"\n', "", text, flags=re.MULTILINE)
        layout = f'target datalayout = "{machine.target_data}"\ntarget triple = "{target.triple}"\n'
        modules.append(llvm.parse_assembly(layout + text))
    first = modules[0]
    for other in modules[1:]:
        first.link_in(other)
    first.verify()
    return first


def _with_short_names(text: str, prefix: str) -> str:
    """The same with names of blocks and values that LLVM reads whole; it cuts off those beyond 1024 characters.

    Args:
        text: intermediate code.
        prefix: of the names that take the place of long ones; nothing in the text may be called so.
    """
    names: dict[str, str] = {}

    def short(found: re.Match[str]) -> str:
        if found[2] is None:
            return found[0]
        return f"{found[1]}{names.setdefault(found[2], f'{prefix}.{len(names)}')}{found[3]}"

    return _LONG_LABEL.sub(short, _LONG_NAME.sub(short, text))


def _hide(module: llvm.ModuleRef, exported: set[str]) -> None:
    for value in (*module.functions, *module.global_variables):
        if not value.is_declaration and value.name not in exported:
            value.linkage = "internal"


def _optimise(module: llvm.ModuleRef, machine: llvm.TargetMachine) -> None:
    options = llvm.create_pipeline_tuning_options(speed_level=2)
    options.loop_vectorization = options.slp_vectorization = False
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)


def _main() -> None:
    try:
        answer = _emitted(json.load(sys.stdin))
    except ExportError as error:
        answer = {"refused": str(error)}
    json.dump(answer, sys.stdout)


if __name__ == "__main__":
    _main()
