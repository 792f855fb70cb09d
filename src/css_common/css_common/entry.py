# SPDX-License-Identifier: Apache-2.0
"""`main` of every installed executable: finds its module and keeps Ctrl-C and closed pipes from printing tracebacks.

Nothing is imported here but the standard library and modules that need no more, because what comes before the first
line of a module cannot be guarded.

A process that had ROS does not take the interpreter apart: threads of the middleware are in it until the end, may crash
what has done its work, and on a loaded machine cost seconds.
"""

import atexit
import importlib
import importlib.util
import os
import sys
from pathlib import Path
from types import ModuleType
from typing import NoReturn

from css_common import network, security, supervised
from css_common.command import plain_interrupts
from css_common.compile_news import tell_of_compiling

_USAGE = 2
_INTERRUPTED = 130


def main() -> int:
    """Runs `main` of PACKAGE/nodes/NAME.py or PACKAGE/commands/NAME.py, started as lib/PACKAGE/NAME; its exit code."""
    ending = _Ending()
    with plain_interrupts():
        supervised.take_on()
        tell_of_compiling()
        module = _module(Path(sys.argv[0]))
    if not _settle_network(module.__name__):
        return _USAGE
    try:
        code = _with_pipe(module.main)
    except KeyboardInterrupt:
        code = _INTERRUPTED
    if ".nodes." in module.__name__:
        _leave(code)  # a node has given up what it held, at its exit is nothing to be done
    ending.code = code
    return code


class _Ending:
    """Leaves after everything else that is to be done at exit: what was registered first comes last.

    Attributes:
        code: exit code of the command; None before it has ended by itself.
    """

    def __init__(self) -> None:
        self.code: int | None = None
        atexit.register(self._last)

    def _last(self) -> None:
        if self.code is not None and "rclpy" in sys.modules:
            _leave(self.code)


def _leave(code: int) -> NoReturn:
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _module(executable: Path) -> ModuleType:
    package, name = executable.parent.name, executable.name
    for folder in ("nodes", "commands"):
        module = f"{package}.{folder}.{name}"
        if importlib.util.find_spec(f"{package}.{folder}") and importlib.util.find_spec(module):
            return importlib.import_module(module)
    raise SystemExit(f"{executable}: there is no {package}/nodes/{name}.py or {package}/commands/{name}.py")


def _settle_network(module: str) -> bool:
    """Keeps ROS on this machine; False, with one line, when the environment asks for what is not to be had."""
    name = module.rpartition(".")[2]
    try:
        note = network.stay_on_this_machine(os.environ)
        if ".nodes." in module and not {"-h", "--help"}.intersection(sys.argv[1:]):
            network.domain_of(os.environ)  # a command that flies holds a domain, and asks itself
            security.check(os.environ)  # as it does for security
    except (network.NetworkError, security.SecurityError) as error:
        print(f"{name}: {error}", file=sys.stderr)
        return False
    if note:
        print(f"{name}: {note}", file=sys.stderr, flush=True)
    return True


def _with_pipe(run) -> int:
    """Runs and writes out what was printed; that nobody reads it to its end (`| head`) is no failure."""
    try:
        try:
            return run()
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        # else Python would try again at its end, and say so
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
