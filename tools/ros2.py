# SPDX-License-Identifier: Apache-2.0
"""A small `ros2` for environments without ros2cli: `run`, `pkg`, `service call`, `param get | set`, `lifecycle set`.

It finds packages and executables through the ament index as ros2run and ros2pkg do, with their messages
and exit codes. It is not ros2cli: topic, node, bag, launch and the rest need a full ROS 2 Jazzy
installation, which Sunpoint uses instead of this file when one is sourced.
"""

from __future__ import annotations

import argparse
import importlib
import os
import shlex
import signal
import sys
from collections.abc import Callable
from pathlib import Path

from ament_index_python import PackageNotFoundError, get_package_prefix, get_packages_with_prefixes

COMMANDS = ("run", "pkg", "service", "param", "lifecycle")


def executables(package: str) -> list[Path]:
    """The executable files below `lib/PACKAGE` of the package's prefix. Raises PackageNotFoundError."""
    found = []
    for folder, subfolders, files in os.walk(Path(get_package_prefix(package), "lib", package)):
        subfolders[:] = sorted(name for name in subfolders if not name.startswith("."))
        found += [Path(folder, name) for name in sorted(files) if os.access(Path(folder, name), os.X_OK)]
    return found


def run(arguments: argparse.Namespace) -> str:
    """Become the executable, so that signals and exit code are its own; returns only with a complaint."""
    paths = [path for path in executables(arguments.package_name) if path.name == arguments.executable_name]
    if not paths:
        return "No executable found"
    if len(paths) > 1:
        return "\n- ".join(["Multiple executables found:", *map(str, paths)])
    command = [*shlex.split(arguments.prefix or ""), str(paths[0]), *arguments.argv]
    # Python ignores this one, and what is ignored stays ignored in the command.
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    try:
        os.execvp(command[0], command)
    except OSError as error:
        return f"{command[0]}: {error.strerror}"


def list_executables(arguments: argparse.Namespace) -> None:
    """Print executables as `PACKAGE NAME` lines, of one package or of all."""
    packages = [arguments.package_name] if arguments.package_name else sorted(get_packages_with_prefixes())
    for package in packages:
        for path in sorted(executables(package)):
            print(path if arguments.full_path else f"{package} {path.name}")


def list_packages(_arguments: argparse.Namespace) -> None:
    """Print the names of all packages in the ament index."""
    print(*sorted(get_packages_with_prefixes()), sep="\n")


def print_prefix(arguments: argparse.Namespace) -> None:
    """Print the prefix of one package, or its share folder."""
    prefix = get_package_prefix(arguments.package_name)
    print(os.path.join(prefix, "share", arguments.package_name) if arguments.share else prefix)


def make_parser() -> argparse.ArgumentParser:
    """The command line of all commands."""
    parser = argparse.ArgumentParser(
        prog="ros2", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="{run,pkg,service,param,lifecycle}")

    runner = commands.add_parser("run", help="run an executable of a package")
    runner.add_argument("--prefix", help="command to put before the executable, e.g. 'gdb -ex run --args'")
    runner.add_argument("package_name", help="name of the ROS package")
    runner.add_argument("executable_name", help="name of the executable")
    runner.add_argument("argv", nargs=argparse.REMAINDER, help="arguments for the executable")
    runner.set_defaults(action=run)

    verbs = commands.add_parser("pkg", help="list packages and executables").add_subparsers(required=True)
    listing = verbs.add_parser("executables", help="list executables")
    listing.add_argument("package_name", nargs="?", help="only of this package")
    listing.add_argument("--full-path", action="store_true", help="print paths")
    listing.set_defaults(action=list_executables)
    verbs.add_parser("list", help="list packages").set_defaults(action=list_packages)
    prefix = verbs.add_parser("prefix", help="print where a package is installed")
    prefix.add_argument("package_name")
    prefix.add_argument("--share", action="store_true", help="print its share folder")
    prefix.set_defaults(action=print_prefix)
    make_calls(commands)
    return parser


def make_calls(commands: argparse._SubParsersAction) -> None:
    """The command line of what is asked of running nodes."""
    verbs = commands.add_parser("service", help="call a service").add_subparsers(required=True)
    call = verbs.add_parser("call", help="call a service and print its answer")
    call.add_argument("service_name", help="for instance /dynamics/pause")
    call.add_argument("service_type", help="for instance std_srvs/srv/Trigger")
    call.add_argument("values", nargs="?", default="{}", help="fields of the request in YAML")
    call.set_defaults(action=later("call_service"))

    verbs = commands.add_parser("param", help="get and set parameters").add_subparsers(required=True)
    for name, does in (("get", "get_parameter"), ("set", "set_parameter")):
        one = verbs.add_parser(name, help=f"{name} a parameter of a running node")
        one.add_argument("node_name", help="for instance /ekf")
        one.add_argument("parameter_name", help="for instance gate")
        if name == "set":
            one.add_argument("value", help="in YAML")
        one.set_defaults(action=later(does))

    verbs = commands.add_parser("lifecycle", help="take nodes through transitions").add_subparsers(required=True)
    change = verbs.add_parser("set", help="take a node through a transition")
    change.add_argument("node_name", help="for instance /gyro")
    change.add_argument("transition", help="configure, activate, deactivate, cleanup or shutdown")
    change.set_defaults(action=later("set_lifecycle"))


def later(name: str) -> Callable[[argparse.Namespace], str | None]:
    """A function of `ros2_calls`, which loads ROS: only when it is called."""

    def action(arguments: argparse.Namespace) -> str | None:
        sys.path.append(str(Path(__file__).parent))
        return getattr(importlib.import_module("ros2_calls"), name)(arguments)

    return action


def main(argv: list[str]) -> int | str | None:
    """Run one command; a string is an error message, as for sys.exit."""
    if argv and not argv[0].startswith("-") and argv[0] not in COMMANDS:
        print(
            f"ros2: '{argv[0]}' is not in this small ros2, which has only: {', '.join(COMMANDS)}.\n"
            "  The real ros2cli comes with a ROS 2 Jazzy installation: https://docs.ros.org/en/jazzy",
            file=sys.stderr,
        )
        return 2
    parser = make_parser()
    if not argv:
        parser.print_help()
        return 0
    arguments = parser.parse_args(argv)
    try:
        return arguments.action(arguments)
    except PackageNotFoundError:
        if arguments.action is print_prefix:
            return "Package not found"
        return f"Package '{arguments.package_name}' not found"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
