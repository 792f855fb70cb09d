# SPDX-License-Identifier: Apache-2.0
"""Flies a mission, or plays a recording, with a page in the browser that shows and drives it.

The page is on this machine alone, at the address that is printed. With --attach nothing is started: the page shows and
drives the graph that runs already.
"""

import argparse

from css_bringup.options import add_domain_option, guarded
from css_common.command import CommandParser, command_parser, implementation
from css_console.errors import ConsoleError

_EXAMPLES = (
    "okeefe_2013 --open",
    "okeefe_2013 --case 137 --rate 10 --paused",
    "bags/reference",
    "--attach",
)
_EXITS = {0: "ended after a flight that was as it should be", 1: "the last flight, or the console itself, failed"}
_NOTES = """\
--attach joins the running flight; --flight NAME|PID or --domain N chooses among several."""


def _port(text: str) -> int:
    if not (text.isascii() and text.isdigit() and int(text) < 1 << 16):
        raise argparse.ArgumentTypeError(f"{text} given, expected a port from 1 to 65535, or 0 for a free one")
    return int(text)


def _rate(text: str) -> float:
    try:
        rate = float(text)
    except ValueError:
        rate = 0.0
    if not rate > 0.0:
        raise argparse.ArgumentTypeError(f"{text} given, expected a number above 0, or inf")
    return rate


def _parser() -> CommandParser:
    parser = command_parser("css_console", "console", __doc__, _EXAMPLES, _EXITS, _NOTES)
    add = parser.add_argument
    add(
        "subject", nargs="?", metavar="MISSION|BAG",
        help="mission to fly (name in config/ or file), or recording to play (default: okeefe_2013)",
    )  # fmt: skip
    add("--attach", action="store_true", help="start nothing: show and drive the graph that runs already")
    add("--case", type=int, metavar="K", help="case number: initial state and noise are drawn for it")
    add("--seed", type=int, metavar="N", help="key of all random streams")
    add("--duration", type=float, metavar="S", help="simulated time to fly [s]")
    add(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides",
        help="change one parameter, for instance --set ekf.use_gyro=false; may be repeated",
    )  # fmt: skip
    add("--rate", type=_rate, metavar="R", help="seconds of flight per second, or inf (default: 10)")
    add("--paused", action="store_true", help="hold at the beginning")
    add("--record", action="store_true", help="record each flight as `fly` does (default: nothing is recorded)")
    add("--port", type=_port, default=8765, metavar="N", help="port on 127.0.0.1; 0: a free one (default: 8765)")
    add("--open", action="store_true", help="open the page in the browser")
    add_domain_option(parser)
    return parser


def main(args: list[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(args)
    starts = (options.case, options.seed, options.duration, options.rate)
    if options.attach and (any(value is not None for value in starts) or options.overrides or options.record):
        parser.error("--attach: starts no flight; expected no --case, --seed, --duration, --set, --rate or --record")
    run = implementation("css_console.verbs.console")
    return guarded(parser.prog, lambda: run(options), (ConsoleError,))
