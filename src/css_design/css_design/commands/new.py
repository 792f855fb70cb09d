# SPDX-License-Identifier: Apache-2.0
"""Writes a mission of your own spacecraft: from size, cells, wheels, rods, sensors and orbit to a file that flies.

On a terminal it asks for what the options leave open. What nobody gives is that of the template, and marked in the
file. Gains follow from inertia, wheels and control cycle, integration steps from rates, gates from the cells' noise.
"""

import signal
from collections.abc import Sequence
from pathlib import Path

from css_common.command import CommandParser, command_parser, guarded, implementation
from css_design.errors import DesignError
from css_design.new_mission.items import ITEMS
from css_design.new_mission.templates import DEFAULT, TEMPLATES

_EXAMPLES = (
    "mysat --template 6u",
    "mysat --size 0.1,0.1,0.2 --mass 2.6 --wheels 3 --wheel-momentum 0.005 --orbit 'sso 550 22:30'",
    "mysat --inertia 0.05,0.04,0.02 --cells +x,-x,+y,-y,0/0.6/0.8 --orbit 'tle mysat.tle' --yes",
    "--list",
)
_EXITS = {0: "written, or listed", 1: "written, with warnings that were named"}


def _parser() -> CommandParser:
    parser = command_parser("css_design", "new", __doc__, _EXAMPLES, _EXITS)
    add = parser.add_argument
    add("name", nargs="?", metavar="NAME", help="name of the mission")
    add("--list", action="store_true", help="list the templates")
    words = "; ".join(f"{name}: {template.description}" for name, template in TEMPLATES.items())
    add("--template", default=DEFAULT, metavar="NAME", help=f"what is begun from (default: {DEFAULT}). {words}")
    for item in ITEMS:
        unit = f" [{item.unit}]" if item.unit else ""
        add(item.flag, dest=item.name, metavar=item.form.replace("'", ""), help=f"{item.question}{unit}")
    add("--yes", action="store_true", help="ask nothing, on a terminal too")
    add("--out", type=Path, metavar="FILE", help="file to write (default: NAME.yaml here)")
    add("--overwrite", action="store_true", help="replace a file that is there")
    add("--json", action="store_true", help="print gains and limits as one JSON object on the last line")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    # a killed terminal or `kill` end it as Ctrl-C does
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    run = implementation("css_design.verbs.new")
    return guarded(
        parser.prog, lambda: run(options), (DesignError, OSError), interrupted="interrupted; nothing written"
    )
