# SPDX-License-Identifier: Apache-2.0
"""Maps how well a mission's layout of coarse sun sensor cells sees the Sun, and how wrong the weighted average is."""

from collections.abc import Sequence
from pathlib import Path

from css_common.command import MISSION_HELP, CommandParser, command_parser, guarded, implementation
from css_common.mission_file import MissionError

_EXAMPLES = (
    "okeefe_2013",
    "okeefe_2013 --set cells.field_of_view_deg=140 --figures maps",
    "my_mission.yaml --json",
)
_EXITS = {2: "the mission or an override is wrong, or a figure cannot be written"}


def _parser() -> CommandParser:
    parser = command_parser("css_monte_carlo", "coverage", __doc__, _EXAMPLES, _EXITS)
    parser.add_argument(
        "mission",
        nargs="?",
        default="okeefe_2013",
        help=MISSION_HELP,
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        dest="overrides",
        help="change one parameter; may be repeated",
    )
    parser.add_argument("--figures", type=Path, metavar="DIR", help="write the maps as PNG files into this folder")
    parser.add_argument("--json", action="store_true", help="print the numbers as one JSON object on the last line")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    run = implementation("css_monte_carlo.verbs.coverage")
    return guarded(parser.prog, lambda: run(options), (MissionError, OSError))
