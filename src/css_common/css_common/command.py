# SPDX-License-Identifier: Apache-2.0
"""The frame around every command: its name as it was typed, its help, one line for what is wrong, its exit code."""

import argparse
import importlib
import math
import os
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Never

DONE = 0
FAILED = 1
USAGE = 2
INTERRUPTED = 130

_EXITS = {DONE: "done", USAGE: "something asked for is wrong", INTERRUPTED: "interrupted"}
_AGAIN_S = 0.1  # until an interrupt that was lost comes again
_RED, _PLAIN = "\x1b[31m", "\x1b[0m"


# Values that begin with a minus and are no options: numbers, several of them, and faces of a body.
_VALUES = re.compile(r"-(\.?\d|[xyz](,|$))")
_PAIR = re.compile(r"[A-Za-z_]\w*(\.\w+)*=")
_PAIRS = "KEY="  # begins the metavar of an option that takes such
_OF_LISTS = type(argparse.ArgumentParser().add_argument("--any", action="append"))


class CommandParser(argparse.ArgumentParser):
    """Parser whose errors look like every other error of the command, and for which `-x` is a face of a body.

    What takes several values takes them behind one option, or behind the option repeated: a list is joined, and a word
    KEY=VALUE behind one that an option of such words has taken is that option's too.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        # as argparse has it for single numbers alone: a word of this kind is a value where no such option is declared
        self._negative_number_matcher = _VALUES

    def add_argument(self, *names: Any, **options: Any) -> argparse.Action:
        """As argparse has it, but lists of a repeated option are joined, where it would forget the first in silence."""
        if options.get("nargs") in ("+", "*") and names[0].startswith("-") and "action" not in options:
            options["action"] = _Joined
        return super().add_argument(*names, **options)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As argparse has it, with `--set A=1 B=2` for `--set A=1 --set B=2`."""
        return super().parse_known_args(self._each_with_its_option(sys.argv[1:] if args is None else args), namespace)

    def _each_with_its_option(self, words: Sequence[str]) -> list[str]:
        names = [name for action in self._actions for name in action.option_strings]
        lists = [action for action in self._actions if isinstance(action, _OF_LISTS)]
        pairs = {name for action in lists if str(action.metavar).startswith(_PAIRS) for name in action.option_strings}
        spread: list[str] = []
        option, has_value = "", False
        for number, word in enumerate(words):
            if word == "--":
                return [*spread, *words[number:]]
            if word.startswith("--"):
                name, equals, _ = word.partition("=")
                meant = [name] if name in names else [known for known in names if known.startswith(name)]
                option = meant[0] if len(meant) == 1 and meant[0] in pairs else ""
                has_value = bool(equals)
            elif option and has_value and _PAIR.match(word):
                spread.append(option)
            elif option and not has_value:
                has_value = True
            else:
                option = ""
            spread.append(word)
        return spread

    def error(self, message: str) -> Never:
        """Prints one line, and ends the process."""
        complain(self.prog, f"{message}; see {self.prog} --help")
        sys.exit(USAGE)


class _Joined(argparse.Action):
    """Values of an option that takes a list, of all the times that it is given; the first takes the default's place."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option_string: Any = None
    ) -> None:
        known = getattr(namespace, self.dest)
        setattr(namespace, self.dest, list(values) if known is self.default else [*known, *values])


MISSION_HELP = "name in config/ or a file, which may extend another mission (default: %(default)s)"
"""Help of the argument that names a mission."""


def command_parser(
    package: str,
    executable: str,
    description: str | None,
    examples: Sequence[str],
    exits: Mapping[int, str] | None = None,
    notes: str = "",
) -> CommandParser:
    """A parser that is called what the user typed.

    Args:
        package: ROS package of the command.
        executable: its name there.
        description: what it is for, in the lines in which it is to be printed.
        examples: arguments of calls that work.
        exits: exit codes with a meaning of their own, beside or in the place of the common ones.
        notes: printed after the options.
    """
    prog = typed_name(package, executable)
    shown = "\n".join(f"  {prog} {arguments}".rstrip() for arguments in examples)
    codes = "\n".join(f"  {code:3d}  {meaning}" for code, meaning in sorted({**_EXITS, **(exits or {})}.items()))
    epilog = "\n\n".join(part for part in (notes.strip(), f"examples:\n{shown}", f"exit codes:\n{codes}") if part)
    return CommandParser(
        prog=prog, description=description, epilog=epilog, formatter_class=argparse.RawDescriptionHelpFormatter
    )


def typed_name(package: str, executable: str) -> str:
    """How a command was started: `./sunpoint VERB`, which leaves its word in the environment, or `ros2 run`."""
    verb, _, of = os.environ.get("SUNPOINT_VERB", "").partition(":")
    # a command that another one starts inherits the environment, but the word is not its own
    return f"./sunpoint {verb}" if verb and of == executable else f"ros2 run {package} {executable}"


def complain(prog: str, message: object, kind: str = "error") -> None:
    """One line on standard error: the command's own name, what kind of news it is, and the news."""
    heading = f"{short_name(prog)}: {kind}:"
    if sys.stderr.isatty() and not os.environ.get("NO_COLOR"):
        heading = f"{_RED}{heading}{_PLAIN}"
    print(heading, message, file=sys.stderr, flush=True)


def short_name(prog: str) -> str:
    """`record` of `./sunpoint record`, `recorder` of `ros2 run css_recording recorder`."""
    words = prog.split()
    skipped = 3 if words[:2] == ["ros2", "run"] else 1 if words[0] == "./sunpoint" else 0
    return " ".join(words[skipped:])


def guarded(
    prog: str,
    command: Callable[[], int],
    wrong: tuple[type[Exception], ...],
    failed: tuple[type[Exception], ...] = (),
    interrupted: str = "interrupted",
) -> int:
    """Runs a command; the errors that it expects become one line each.

    Args:
        prog: name of the command as its parser has it.
        command: does the work and gives an exit code.
        wrong: errors in what the user gave: exit code 2.
        failed: errors in what came of it: exit code 1.
        interrupted: what Ctrl-C is answered with; exit code 130.
    """
    try:
        with no_lost_interrupts():
            return command()
    except failed as error:
        complain(prog, _words(error))
        return FAILED
    except wrong as error:
        complain(prog, _words(error))
        return USAGE
    except KeyboardInterrupt:
        print(f"{short_name(prog)}: {interrupted}", file=sys.stderr, flush=True)
        return INTERRUPTED


def _words(error: Exception) -> str:
    """What an error says; of the system the file and the reason, without a number that nobody knows."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return str(error)


def implementation(module: str) -> Callable[..., int]:
    """What a command does: `run` of a module that is loaded now, once options are read, for that takes a second.

    Args:
        module: full name.
    """
    with plain_interrupts():
        return importlib.import_module(module).run


@contextmanager
def plain_interrupts() -> Iterator[None]:
    """Ctrl-C just ends: for imports, as libraries take an exception in the middle of theirs badly."""
    interrupt = signal.getsignal(signal.SIGINT)
    if interrupt is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        yield
    finally:
        if interrupt is signal.default_int_handler:
            signal.signal(signal.SIGINT, interrupt)


@contextmanager
def no_lost_interrupts() -> Iterator[None]:
    """Ctrl-C that comes where no exception can be raised, as while the compiler calls back, comes again a little later.

    What is compiled takes seconds without a line of Python, so that it comes there more often than not.
    """
    told, timers = sys.unraisablehook, []

    def again(unraisable: Any) -> None:
        if not issubclass(unraisable.exc_type, KeyboardInterrupt):
            told(unraisable)
            return
        timers.append(threading.Timer(_AGAIN_S, os.kill, (os.getpid(), signal.SIGINT)))
        timers[-1].daemon = True
        timers[-1].start()

    sys.unraisablehook = again
    try:
        yield
    finally:
        sys.unraisablehook = told
        for timer in timers:
            timer.cancel()


def number(expected: str, accepts: Callable[[float], bool]) -> Callable[[str], float]:
    """Type of an option that takes a number; not-a-number is none, and what is refused is said with what is right.

    Args:
        expected: what is right, for instance "a number above 0".
        accepts: whether a number is.
    """

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if math.isnan(value) or not accepts(value):
            raise argparse.ArgumentTypeError(f"{text} given, expected {expected}")
        return value

    return parse


positive = number("a number above 0", lambda value: 0.0 < value < math.inf)
"""Type of an option: a finite number above zero."""
