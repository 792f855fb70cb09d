# SPDX-License-Identifier: Apache-2.0
"""One implementation of mathematics for all processors: that of musl, compiled into a library beside its kernel.

Sources (musl's `src/math`, MIT and the permissive licences of its parts) and the compiler that reads them (clang) come
from one package, whose release and hash requirements-export.lock holds. They become intermediate code once, without
contraction of multiplications and additions, and machine code as the kernel does. Each function has a name of its own,
so that what else is linked into the image keeps the mathematics that it has.

What IEEE 754 defines to the last bit (square root, rounding, remainder) is left to the processor, and where it has no
instruction for it, is taken from here too.
"""

import re
import subprocess
import tempfile
from collections.abc import Iterable
from functools import cache, lru_cache
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

from css_export.errors import ExportError

RELEASE = "0.13.0"
"""Of ziglang; requirements-export.in says why that one."""
NAME = f"musl of ziglang {RELEASE}"
INSTALL = './sunpoint shell -c "uv pip install -r requirements-export.lock"'

PREFIX = "sunpoint.math."
"""With which the names of shipped functions begin."""
_INSTRUCTIONS = frozenset(
    ["ceil", "copysign", "fabs", "floor", "fma", "nearbyint", "rint", "round", "roundeven", "sqrt", "trunc"]
)
_DOUBLE = _INSTRUCTIONS | {"fmax", "fmin", "fmod", "maxnum", "minnum", "remainder"}
EXACT = _DOUBLE | {f"{name}f" for name in _DOUBLE}
"""Functions that IEEE 754 defines to the last bit, by their names in C and in LLVM."""
# -disable-llvm-passes: this is optimised with the kernel, for its processor
_FLAGS = (
    *("-target", "x86_64-linux-musl", "-mcpu=baseline", "-std=c99", "-O2", "-g0", "-ffp-contract=off", "-fno-builtin"),
    *("-fno-pic", "-fno-stack-protector", "-fno-sanitize=all", "-fno-asynchronous-unwind-tables"),
    *("-Xclang", "-disable-llvm-passes", "-S", "-emit-llvm"),
)
_INCLUDED = ("arch/generic", "src/include", "src/internal")
_NAMED = re.compile(r"@(?!llvm\.)([\w.$]+)")
_DEFINED = re.compile(r"^(?:define [^@]*@([\w.$]+)\(|@([\w.$]+) = (?!external))", re.MULTILINE)
_DECLARED = re.compile(r"^declare ([^@\n]*)@(?:llvm\.)?(\w+?)(\.(?:v\d+)?f(?:64|32))?\(([^)\n]*)\).*\n", re.MULTILINE)
_FLAGGED = re.compile(r"^!llvm\.module\.flags = .*\n", re.MULTILINE)
_UNWOUND = re.compile(r" uwtable(?:\(sync\))?(?= )")
_VECTOR = re.compile(r"<(\d+) x (double|float)>")


def available() -> frozenset[str]:
    """Names in C of the functions that can be shipped.

    Raises:
        ExportError: the package that brings them is not installed, or another release of it is.
    """
    return frozenset(file.stem for file in (_musl() / "src" / "math").glob("*.c") if not file.stem.startswith("_"))


def notice() -> str:
    """The licence of what is shipped, which goes with it.

    Raises:
        ExportError: as `available`.
    """
    return (_musl() / "COPYRIGHT").read_text(encoding="utf-8")


def with_mathematics(texts: Iterable[str], also: Iterable[str] = ()) -> list[str]:
    """Modules that call functions of the C library, and the modules with those that they call instead.

    Args:
        texts: of intermediate code.
        also: names of functions defined to the last bit that the processor has no instruction for.

    Raises:
        ExportError: as `available`; or the functions cannot be compiled.
    """
    left = EXACT - frozenset(also)
    wanted: set[str] = set()
    changed = [_redirected(text, available() - left, wanted) for text in texts]
    return changed + _closure(wanted, left)


def _redirected(text: str, taken: frozenset[str], wanted: set[str]) -> str:
    """A module that calls shipped functions; their names in C are added to `wanted`."""
    added: dict[str, str] = {}
    names: dict[str, str] = {}

    def without(found: re.Match[str]) -> str:
        kind, name, suffix = found[1], found[2], found[3] or ""
        single = f"{name}f" if suffix.endswith("f32") else name
        if single not in taken:
            return found[0]
        wanted.add(single)
        vector = _VECTOR.search(kind)
        count = found[4].count(",") + 1
        scalar = vector[2] if vector else kind.split()[-1]
        ours = f"{PREFIX}{single}"
        added[ours] = f"declare {scalar} @{ours}({', '.join([scalar] * count)})\n"
        old = f"llvm.{name}{suffix}" if suffix else name
        names[old] = ours
        if vector:
            names[old] = f"{ours}.v{vector[1]}"
            added[names[old]] = _of_lanes(names[old], ours, scalar, int(vector[1]), count)
        return ""

    text = _DECLARED.sub(without, text)
    for old, new in names.items():
        text = text.replace(f"@{old}(", f"@{new}(")
    return text + "".join(added.values())


def _of_lanes(name: str, scalar_name: str, scalar: str, lanes: int, count: int) -> str:
    """A function of vectors that calls one of numbers, lane by lane."""
    vector = f"<{lanes} x {scalar}>"
    lines = [f"define internal {vector} @{name}({', '.join(f'{vector} %a{i}' for i in range(count))}) nounwind {{"]
    last = "poison"
    for k in range(lanes):
        lines += [f"  %x{k}.{i} = extractelement {vector} %a{i}, i32 {k}" for i in range(count)]
        given = ", ".join(f"{scalar} %x{k}.{i}" for i in range(count))
        lines += [f"  %y{k} = call {scalar} @{scalar_name}({given})"]
        lines += [f"  %v{k} = insertelement {vector} {last}, {scalar} %y{k}, i32 {k}"]
        last = f"%v{k}"
    return "\n".join([*lines, f"  ret {vector} {last}", "}", ""])


def _closure(wanted: set[str], left: frozenset[str]) -> list[str]:
    """Modules of functions and of all that these call.

    Args:
        wanted: names in C.
        left: names of functions that they go on to call as instructions or from the C library.
    """

    def ours(found: re.Match[str]) -> str:
        name = found[1]
        if name not in left:
            return f"@{PREFIX}{name}"
        return f"@llvm.{name}.f64" if name in _INSTRUCTIONS else found[0]

    texts: dict[str, str] = {}
    waiting, defined = set(wanted), set[str]()
    while waiting:
        name = min(waiting)
        file = _file_of(name)
        text = _compiled(file)
        texts[file] = _NAMED.sub(ours, text)
        defined |= {a or b for a, b in _DEFINED.findall(text)}
        if name not in defined:
            raise ExportError(f"mathematics of {NAME}: {file} does not define {name}")
        waiting = (waiting | set(_NAMED.findall(text))) - defined - left
    return list(texts.values())


def _file_of(name: str) -> str:
    """Where a function or a table is defined: in the file of that name, or in one of data that names it."""
    folder = _musl() / "src" / "math"
    if (folder / f"{name}.c").is_file():
        return f"{name}.c"
    for file in sorted(folder.glob("*_data.c")):
        if re.search(rf"\b{name}\b", file.read_text(encoding="utf-8")):
            return file.name
    raise ExportError(f"mathematics of {NAME}: nothing there defines {name}")


@lru_cache
def _musl() -> Path:
    try:
        release = metadata.version("ziglang")
    except metadata.PackageNotFoundError:
        release = "none"
    found = find_spec("ziglang")
    if release != RELEASE or found is None or found.origin is None:
        raise ExportError(f"--mathematics musl: needs ziglang {RELEASE}, {release} is installed: {INSTALL}")
    return Path(found.origin).parent / "lib" / "libc" / "musl"


@cache
def _compiled(file: str) -> str:
    """Intermediate code of a file of musl's mathematics."""
    musl = _musl()
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "text.ll"
        includes = [word for part in _INCLUDED for word in ("-I", str(musl / part))]
        command = [str(musl.parents[2] / "zig"), "cc", *_FLAGS, *includes, "-o", str(out)]
        try:
            done = subprocess.run([*command, str(musl / "src" / "math" / file)], capture_output=True, check=False)
        except OSError as error:
            raise ExportError(f"mathematics of {NAME}: {command[0]}: {error.strerror}") from error
        if done.returncode != 0:
            said = done.stderr.decode(errors="replace").strip().splitlines()
            raise ExportError(f"mathematics of {NAME}: {file}: {said[0] if said else f'clang: {done.returncode}'}")
        text = out.read_text(encoding="utf-8")
    # what flies is not unwound
    return _FLAGGED.sub("", _UNWOUND.sub("", text))
