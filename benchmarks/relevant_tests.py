# SPDX-License-Identifier: Apache-2.0
"""Which test files see a module, directly or through what they import, nearest first."""

import ast
from collections import deque
from functools import cache
from pathlib import Path

# This module imports what missions name: whoever loads a mission may run any node.
_LOADER = "css_common.node_files"
# They run what is installed with ROS against what is laid out without: with a mutant on both sides.
_LEFT_OUT = ("test_without_ros.py",)
# It looks at the options of all packages, in a second.
_OF_ALL = ("test_option_ranges.py",)
# This module imports the paper that it is asked for.
_PAPERS = "css_papers.papers"
# This module draws every figure of the documentation.
_FIGURES = "css_docs.figure_files"
# Whoever knows the verbs starts their executables.
_VERBS = "bootstrap.verbs"


class Sources:
    """The import graph of packages and tests below a folder."""

    def __init__(self, root: Path) -> None:
        self.root = root
        files = [file for file in sorted(root.glob("src/*/*/**/*.py")) if file.relative_to(root).parts[2] != "test"]
        self.modules = {_module(root, file): file for file in files if file.relative_to(root).parts[2] != "launch"}
        tests = [*sorted(root.glob("src/*/test/*.py")), *sorted(root.glob("tests/*.py"))]
        self.helpers = {file.stem: file for file in tests if not file.name.startswith("test_")}
        self.tests = [file for file in tests if file.name.startswith("test_") and file.name not in _LEFT_OUT]

    def seen_by(self, mutated: Path, beyond: int) -> tuple[list[Path], list[Path]]:
        """Test files of the package of a source file that see it, and at most `beyond` others, both nearest first.

        What looks at all packages comes before those others, and does not count.
        """
        distances = {test: self._distance(test, mutated) for test in self.tests}
        known = [test for test in self.tests if distances[test] is not None]
        package, across = self.root / "src" / mutated.relative_to(self.root).parts[1], self.root / "tests"
        words = set(mutated.stem.split("_"))

        def order(test: Path) -> tuple[object, ...]:
            # at the same distance those that fly several packages together come before those of another package, and
            # those that are named alike before all that need the module by the way
            alike = len(words & set(test.stem.split("_")))
            return distances[test], not test.is_relative_to(across), -alike, test.parts

        known.sort(key=order)
        own = [test for test in known if test.is_relative_to(package)]
        of_all = [test for test in known if test.name in _OF_ALL]
        return own, [*of_all, *[test for test in known if test not in (*own, *of_all)][:beyond]]

    def _distance(self, test: Path, mutated: Path) -> int | None:
        """Imports from a test file to a source file; None: no way leads there."""
        waiting, seen = deque([(test, 0)]), {test}
        while waiting:
            file, distance = waiting.popleft()
            if file == mutated:
                return distance
            for imported in self._imported(file):
                if imported not in seen:
                    seen.add(imported)
                    waiting.append((imported, distance + 1))
        return None

    @cache  # noqa: B019 (lives as long as the program)
    def _imported(self, file: Path) -> tuple[Path, ...]:
        names: set[str] = set()
        for node in ast.walk(ast.parse(file.read_bytes())):
            if isinstance(node, ast.Import):
                names.update(alias.name for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module:
                names.add(node.module)
                names.update(f"{node.module}.{alias.name}" for alias in node.names)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                names.add(node.value)  # a module that is imported by its name, when it is needed
            elif isinstance(node, ast.Call):
                # an executable that is started, by package and name
                values = (argument.value for argument in node.args[:2] if isinstance(argument, ast.Constant))
                named = [value for value in values if isinstance(value, str)]
                if len(named) == 2:
                    names.update((f"{named[0]}.commands.{named[1]}", f"{named[0]}.nodes.{named[1]}"))
        found = [self.modules[name] for name in sorted(names) if name in self.modules]
        found += [self.helpers[name] for name in sorted(names) if name in self.helpers]
        if self.modules.get(_LOADER) == file:
            found += [source for name, source in self.modules.items() if ".nodes." in name]
        if self.modules.get(_PAPERS) == file:
            found += [source for name, source in self.modules.items() if name.endswith(".paper")]
        if self.modules.get(_FIGURES) == file:
            found += [source for name, source in self.modules.items() if ".figures." in name]
        if _VERBS in names:
            found += [source for name, source in self.modules.items() if ".commands." in name]
        return tuple(found)


def _module(root: Path, file: Path) -> str:
    parts = file.relative_to(root / "src").with_suffix("").parts[1:]
    return ".".join(parts).removesuffix(".__init__")
