# SPDX-License-Identifier: Apache-2.0
"""Flies a mission in real time with a board in the loop.

The simulation sends what the sensors say to the board, each control cycle, and takes the board's
command for wheels and rods back. docs/hil.md has the format of the frames and a client in C.
"""

from css_bringup.options import add_domain_option, add_mission_options, add_output_options, guarded
from css_common.command import CommandParser, command_parser, implementation, positive

_EXAMPLES = (
    "okeefe_2013 --serial /dev/ttyUSB0",
    "okeefe_2013 --serial /dev/ttyACM0 --baud 115200 --duration 600",
    "cubesat_3u_safe --udp 192.168.7.2:47000 --estimate",
)
_EXITS = {
    0: "flown, every frame answered, all pass criteria of the mission met",
    1: "frames were lost, late or damaged, the board was silent, or a criterion was missed",
}


def _parser() -> CommandParser:
    parser = command_parser("css_bringup", "hil", __doc__, _EXAMPLES, _EXITS)
    add_mission_options(parser)
    way = parser.add_mutually_exclusive_group(required=True)
    way.add_argument("--serial", metavar="PORT", help="serial device of the board")
    way.add_argument("--udp", metavar="HOST:PORT", help="address of the board")
    parser.add_argument("--baud", type=int, metavar="N", help="bits a second of the serial device (default 921600)")
    parser.add_argument("--listen", type=int, metavar="PORT", help="own UDP port (default: any)")
    parser.add_argument(
        "--within",
        type=float,
        metavar="SHARE",
        help="share of the control cycle in which an answer counts (default 0.8)",
    )
    parser.add_argument(
        "--hold", type=int, metavar="N",
        help="so many cycles without an answer keep the last command; then actuators rest (default 0)",
    )  # fmt: skip
    parser.add_argument(
        "--estimate", action="store_true", help="record the board's direction to the Sun as that of an estimator"
    )
    parser.add_argument(
        "--wait", type=positive, default=10.0, metavar="S", help="time that the board has to answer at all (default 10)"
    )
    parser.add_argument(
        "--silence", type=positive, default=10.0, metavar="S",
        help="the flight ends when the board has not answered for so long (default 10); until then actuators rest",
    )  # fmt: skip
    parser.add_argument("--no-record", action="store_true", help="fly without a recording and figures of merit")
    add_domain_option(parser)
    add_output_options(parser)
    return parser


def main(args: list[str] | None = None) -> int:
    """Entry point; 0: flown, all frames answered and all pass criteria of the mission met."""
    parser = _parser()
    arguments = parser.parse_args(args)
    run = implementation("css_bringup.verbs.hil")
    return guarded(parser.prog, lambda: run(arguments))
