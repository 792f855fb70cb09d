# SPDX-License-Identifier: Apache-2.0
"""Command-line options that several commands share, and the frame around every command."""

import argparse
from collections.abc import Callable
from pathlib import Path

from rich.console import Console
from rich.text import Text

from css_common import command
from css_common.domains import DomainError
from css_common.mission_file import MissionError
from css_common.network import NetworkError
from css_common.security import SecurityError
from css_recording.errors import BagError

# without markup: units, paths and what people type may hold brackets
console = Console(stderr=False, highlight=False, markup=False)
errors = Console(stderr=True, highlight=False, markup=False)


def add_mission_options(parser: argparse.ArgumentParser) -> None:
    """Mission name and what may be changed in it."""
    parser.add_argument(
        "mission",
        nargs="?",
        default="okeefe_2013",
        help=command.MISSION_HELP,
    )
    parser.add_argument("--case", type=int, metavar="K", help="case number: initial state and noise are drawn for it")
    parser.add_argument("--seed", type=int, metavar="N", help="key of all random streams")
    parser.add_argument("--duration", type=float, metavar="S", help="simulated time to fly [s]")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides",
        help="change one parameter, for instance --set ekf.use_gyro=false; may be repeated",
    )  # fmt: skip


def add_domain_option(parser: argparse.ArgumentParser) -> None:
    """Where a flight has its world for itself."""
    parser.add_argument(
        "--domain", metavar="N", help="ROS domain to fly in (default: ROS_DOMAIN_ID when set, else a free one)"
    )


def add_security_option(parser: argparse.ArgumentParser) -> None:
    """Whose messages a flight takes."""
    parser.add_argument(
        "--security", type=Path, metavar="KEYSTORE", help="fly with DDS security enforced, by this keystore of SROS 2"
    )


def whole_number(text: str) -> int:
    """A count from the command line, at least 1."""
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} given, expected a whole number from 1 on")
    return value


def add_output_options(parser: argparse.ArgumentParser) -> None:
    """Where results go and how they are printed."""
    parser.add_argument("--out", type=Path, metavar="DIR", help="recording folder (default: bags/MISSION_CASE_TIME)")
    parser.add_argument("--overwrite", action="store_true", help="replace a recording that is there")
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object on the last line")


def complain(heading: str, text: object = "") -> None:
    """One line on standard error with its heading in red."""
    errors.print(Text(heading, style="red"), str(text), soft_wrap=True)


class FiguresError(Exception):
    """Figures that cannot be written, with the folder and the reason."""


def guarded(prog: str, run: Callable[[], int], failed: tuple[type[Exception], ...] = ()) -> int:
    """Runs a command; what the user got wrong becomes one line and exit code 2, Ctrl-C becomes 130.

    Args:
        prog: name of the command as its parser has it.
        run: does the work and gives an exit code.
        failed: errors that become one line and exit code 1.
    """
    return command.guarded(
        prog, run, (MissionError, BagError, FiguresError, DomainError, NetworkError, SecurityError), failed
    )
