# SPDX-License-Identifier: Apache-2.0
"""Flies a mission on the real graph and records it."""

from css_bringup.options import add_domain_option, add_mission_options, add_output_options, add_security_option, guarded
from css_common.command import CommandParser, command_parser, implementation
from css_report.page_option import add_page_option

_EXAMPLES = (
    "okeefe_2013",
    "okeefe_2013 --case 137 --set ekf.use_gyro=false",
    "okeefe_2013 --duration 600 --processes --out bags/mine",
    "my_mission.yaml --realtime 10",
    "okeefe_2013 --stay --paused --no-record",
)
_EXITS = {0: "flown, and all pass criteria of the mission met", 1: "the flight failed or missed a criterion"}


def _parser() -> CommandParser:
    parser = command_parser("css_bringup", "fly", __doc__, _EXAMPLES, _EXITS)
    add_mission_options(parser)
    parser.add_argument("--processes", action="store_true", help="one supervised process per node")
    parser.add_argument(
        "--realtime", type=float, nargs="?", const=1.0, metavar="FACTOR",
        help="pace against the wall clock (default factor 1.0)",
    )  # fmt: skip
    parser.add_argument(
        "--component", action="append", default=[], metavar="NODE=FILE", dest="components",
        help="fly a library of `export`, or a program that speaks as it does, in the place of a node's compiled "
        "function; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--stay", action="store_true",
        help="stay after the end, and fly again when the service /flight/reset asks for it; Ctrl-C ends it",
    )  # fmt: skip
    parser.add_argument("--paused", action="store_true", help="hold at the epoch until the plant's service resume")
    parser.add_argument("--no-record", action="store_true", help="fly without a recording and figures of merit")
    add_domain_option(parser)
    add_security_option(parser)
    add_output_options(parser)
    add_page_option(parser)
    return parser


def main(args: list[str] | None = None) -> int:
    """Entry point; 0: flown and all pass criteria of the mission met."""
    parser = _parser()
    arguments = parser.parse_args(args)
    if arguments.components and arguments.processes:
        parser.error("--component: libraries fly in one process; expected no --processes")
    if arguments.stay and (arguments.processes or arguments.components or arguments.out):
        parser.error("--stay: flights one after another in one process, each recorded under a name of its own; "
                     "expected no --processes, --component or --out")  # fmt: skip
    if arguments.paused and not arguments.stay:
        parser.error("--paused: expected --stay with it")
    run = implementation("css_bringup.verbs.fly")
    return guarded(parser.prog, lambda: run(arguments))
