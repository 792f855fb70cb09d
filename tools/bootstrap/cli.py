# SPDX-License-Identifier: Apache-2.0
"""Turns a command line into the verb's own process, after making sure that everything is in place."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

from bootstrap.environment import (
    DISTRIBUTION,
    NONE,
    compose,
    machine_of,
    ros_source,
    without_foreign_python,
    without_other_sunpoint,
)
from bootstrap.plan import find_need
from bootstrap.project import Project, Refusal, State
from bootstrap.verbs import JOINING, JOINING_OPTIONS, OWN_USAGE, VERBS, help_text, unknown_verb
from css_common.network import NetworkError, stay_on_this_machine

# Two processes, because every test of the graph waits for its nodes more than it computes.
# The tests of a file on one processor: what they share is made once. In their order: the long ones come first.
ALL_TESTS = ["-q", "-n", "2", "--dist", "loadfile", "--no-loadscope-reorder", "-m", "not long"]


def main(arguments: list[str]) -> int:
    """Run one command line; returns only when no executable has taken over."""
    if not arguments or arguments[0] in ("-h", "--help", "help"):
        print(help_text(machine_of(os.environ)))
        return 0
    project = Project(Path(__file__).resolve().parents[2], machine_of(os.environ))
    if arguments[0] == "--version":
        from bootstrap.version import version_text

        print(version_text(project))
        return 0
    verb, *rest = arguments
    if verb not in VERBS:
        print(unknown_verb(verb), file=sys.stderr)
        return 2
    if verb in OWN_USAGE and rest[:1] in (["-h"], ["--help"]):
        print(OWN_USAGE[verb])
        return 0
    try:
        return _start(project, verb, rest)
    except NetworkError as error:
        _say(str(error))
        return 2
    except Refusal as refusal:
        _say(str(refusal))
        if refusal.remedy:
            print(f"  {refusal.remedy}", file=sys.stderr)
        return refusal.exit_code
    except KeyboardInterrupt:
        _say("interrupted")
        return 130


def _say(line: str) -> None:
    print(f"sunpoint: {line}", file=sys.stderr, flush=True)


def _start(project: Project, verb: str, arguments: list[str]) -> int:
    base, foreign = without_foreign_python(without_other_sunpoint(os.environ))
    ros = ros_source(base, project.machine)
    asks_for_help = bool({"-h", "--help"}.intersection(arguments))
    if ros == NONE and VERBS[verb].ros and not asks_for_help:
        raise Refusal(
            f"{verb} needs ROS 2 Jazzy, which has no packages for {project.machine} to install; where one is on this "
            f"machine: source /opt/ros/{DISTRIBUTION}/setup.bash"
        )
    state = State.load(project.state_file)
    with_tests = verb in ("test", "lint")
    extra = "" if asks_for_help else VERBS[verb].extra
    if find_need(project, ros, state, with_tests, extra):
        state = _prepare(project, ros, base, with_tests, extra)
    env = compose(base, state.environment)
    if extra:
        env["PYTHONPATH"] = os.pathsep.join(filter(None, (str(project.extra(extra)), env.get("PYTHONPATH"))))
    if foreign:
        _say(f"PYTHONPATH is left out but for a sourced ROS: {os.pathsep.join(foreign)}")
    if note := stay_on_this_machine(env):
        _say(note)
    if verb == "lint":
        return _lint(project, env)
    if verb == "test":
        return _test(project, arguments, {**env, "ROS_PYTHON_CHECK_FIELDS": "1"})
    if (verb in JOINING or "--attach" in arguments) and ros != NONE:
        env, arguments = _join(verb, env, arguments)
    if verb == "shell":
        return _replace_process(_shell(project, arguments), {"ROS_PYTHON_CHECK_FIELDS": "1", **env})
    package, executable = VERBS[verb].package, VERBS[verb].executable
    file = project.executable(package, executable)
    if not file.is_file():
        raise Refusal(f"package {package} has no executable {executable}")
    # the word that was typed, for the help and the errors of the program that it stands for
    return _replace_process([str(file), *arguments], {**env, "SUNPOINT_VERB": f"{verb}:{executable}"})


def _prepare(project: Project, ros: str, base: dict[str, str], with_tests: bool, extra: str) -> State:
    from bootstrap.progress import Terminated
    from bootstrap.workspace import prepare  # late: a start with nothing to do stays fast

    try:
        return prepare(project, ros, base, with_tests, extra)
    except Terminated as stop:
        sys.exit(stop.exit_code)


def _lint(project: Project, env: dict[str, str]) -> int:
    """Run ruff and mypy."""
    from bootstrap.checks import STYLE, TYPES, failing_linters

    return 1 if failing_linters(project, env, (*STYLE, TYPES)) else 0


def _test(project: Project, arguments: list[str], env: dict[str, str]) -> int:
    """Run ruff unless some tests are named, then become pytest. mypy is one of the tests: it runs beside others."""
    from bootstrap.checks import STYLE, failing_linters, pytest_command

    os.chdir(project.root)
    failing = [] if arguments else failing_linters(project, env, STYLE)
    return _replace_process(pytest_command(project, arguments or ALL_TESTS, failing), env)


def _join(verb: str, env: dict[str, str], arguments: list[str]) -> tuple[dict[str, str], list[str]]:
    """Enter the ROS domain of the running flight, or the one that is asked for; the rest of the command line."""
    if verb != "shell" and {"-h", "--help"}.intersection(arguments):
        print(f"./sunpoint {verb} takes besides the options below:\n{JOINING_OPTIONS}\n")
        return env, arguments
    from bootstrap.joining import join, split_wish

    wish, arguments = split_wish(arguments, before_words=verb == "shell")
    env, why = join(env, wish, must_choose=verb != "shell")
    _say(why)
    return env, arguments


def _shell(project: Project, arguments: list[str]) -> list[str]:
    """bash with the given arguments, or an interactive one that greets with a hint."""
    if arguments:
        return ["bash", *arguments]
    return ["bash", "--rcfile", str(project.root / "tools" / "shell.bash"), "-i"]


def _replace_process(command: list[str], env: dict[str, str]) -> int:
    """Become the command, so that its signals and exit code are its own."""
    sys.stdout.flush()
    for ignored in (signal.SIGPIPE, signal.SIGXFSZ):
        # Python ignores these, and what is ignored would stay ignored in the command.
        signal.signal(ignored, signal.SIG_DFL)
    os.execvpe(command[0], command, env)
