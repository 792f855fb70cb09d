# SPDX-License-Identifier: Apache-2.0
"""Which source files a compiled kernel is made from, as one hash.

A kernel is its own module and what that imports, all the way down; a loop that is handed its kernels by the type of
its parameters may be made from any module that holds kernels. Standard library only: it runs at every start.
"""

import hashlib
import importlib.util
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

KERNEL_PACKAGES = (
    "css_common",
    "css_sensors",
    "css_environment",
    "css_sim",
    "css_estimation",
    "sunpoint_control",
    "css_analysis",
    "css_monte_carlo",
    "css_papers",
    "css_design",
)
_CALLED_BY_TYPE = KERNEL_PACKAGES[:6]  # nothing calls upwards

# what stands at the beginning of a line: kernels are compiled with the names of their module
_IMPORT = re.compile(r"^(?:from +([\w.]+) +import +(\([^)]*\)|.+)|import +(.+))$", re.MULTILINE)
_COMMENT = re.compile(r"#.*")
_HOLDS_KERNELS = re.compile(r"^from css_common\.kernel import ", re.MULTILINE)


def sources_of(module: str) -> frozenset[Path]:
    """Source files of a module and of all that it imports, but for the standard library and installed packages."""
    found: set[Path] = set()
    waiting = [module]
    while waiting:
        source = _source(waiting.pop())
        if source is not None and source not in found:
            found.add(source)
            waiting += _imports(source)
    return frozenset(found)


@cache
def kernel_modules() -> frozenset[Path]:
    """Source files of every module whose kernels a study may call, and of all that these import."""
    found: set[Path] = set()
    for package in _CALLED_BY_TYPE:
        folder = _folder(package)
        if folder is not None:
            for source in folder.rglob("*.py"):
                if source not in found and _HOLDS_KERNELS.search(_text(source)):
                    name = ".".join((package, *source.relative_to(folder).with_suffix("").parts))
                    found |= sources_of(name)
    return frozenset(found)


def hash_of(sources: frozenset[Path], compiler: str) -> str:
    """Hash of source files and of the compiler that reads them."""
    digest = hashlib.sha256(compiler.encode())
    for name, source in sorted((source.parts[-3:], source) for source in sources):
        digest.update(f"{name}\n{_text(source)}\0".encode())
    return digest.hexdigest()[:16]


@cache
def _text(source: Path) -> str:
    return source.read_text(encoding="utf-8")


@cache
def _imports(source: Path) -> tuple[str, ...]:
    return tuple(_imported_names(_text(source)))


def _imported_names(text: str) -> Iterator[str]:
    for module, names, modules in _IMPORT.findall(text):
        if modules:
            yield from (entry.split()[0] for entry in _COMMENT.sub("", modules).split(","))
            continue
        yield module
        for name in _COMMENT.sub("", names).strip("() \n").split(","):
            if name.strip():
                yield f"{module}.{name.split()[0]}"  # a module of a package; anything else is no file


@cache
def _source(module: str) -> Path | None:
    """The file of a module that is ours to edit, if it is one."""
    package, *rest = module.split(".")
    if package in sys.stdlib_module_names:
        return None
    folder = _folder(package)
    if folder is None:
        file = Path(getattr(sys.modules.get(module), "__file__", None) or "")
        return file if file.suffix == ".py" and not rest and not _is_installed(file) else None
    for source in (folder.joinpath(*rest).with_suffix(".py") if rest else None, folder.joinpath(*rest, "__init__.py")):
        if source is not None and source.is_file():
            return source
    return None


@cache
def _folder(package: str) -> Path | None:
    """Where a package lies that is one of ours, or of a user's workspace."""
    try:
        spec = importlib.util.find_spec(package)
    except ValueError:  # __main__ has none
        return None
    if spec is None or not spec.submodule_search_locations:
        return None
    folder = Path(next(iter(spec.submodule_search_locations)))
    if (folder / "msg").is_dir():
        return None  # messages: generated or made from their definitions, and in no kernel
    return folder if package in KERNEL_PACKAGES or not _is_installed(folder) else None


def _is_installed(place: Path) -> bool:
    return not {"site-packages", "dist-packages"}.isdisjoint(place.parts)
