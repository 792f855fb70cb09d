# SPDX-License-Identifier: Apache-2.0
"""Calibrates cells, magnetometer and gyro from a recording: by its true Sun or attitude, or by rates, field and place.

Batch least squares over all of it. Of each cell scale, dark level, two tilts of its normal and, with a temperature, its
coefficient; of the magnetometer bias, scale and soft iron; of the gyro its bias: each with its standard deviation, and
what the recording cannot tell named and left as it is. The outputs at the end are held out and show what it is worth:
to the cells of one instant, and to each Sun estimator that the recording can feed.
"""

from collections.abc import Sequence
from pathlib import Path

from css_calibration.recording_command import add_recording, run_command
from css_common.command import CommandParser, command_parser, number

_EXAMPLES = (
    "bags/FLIGHT",
    "bags/FLIGHT --reference batch --out my_cells.yaml",
    "bags/mine --response cosine --extends okeefe_2013 --out config/my_spacecraft.yaml --json",
)
_EXITS = {
    0: "calibrated, and the heading of the part that was held out errs by less",
    1: "calibrated, but the heading there errs by no less, an estimator's by more, or dark levels alone were told",
    2: "the recording has nothing to hold the cells against, or what is asked for is wrong",
}
_NOTES = """\
The file is a ROS parameter file: replay takes it by --calibration, nodes by --params-file behind the mission's, and
with --extends MISSION it is a mission itself."""


def _parser() -> CommandParser:
    parser = command_parser("css_calibration", "calibrate", __doc__, _EXAMPLES, _EXITS, _NOTES)
    add_recording(parser)
    parser.add_argument("--out", type=Path, metavar="FILE", help="calibration file (default: BAG_calibration.yaml)")
    parser.add_argument("--overwrite", action="store_true", help="replace a file that is there")
    parser.add_argument("--extends", metavar="MISSION", help="write a mission that extends this one")
    parser.add_argument(
        "--reference", choices=("auto", "truth", "batch"), default="auto",
        help="true Sun or attitude, or attitude from rates, field and place (default: a truth if there is one)",
    )  # fmt: skip
    parser.add_argument(
        "--response", choices=("auto", "cosine", "okeefe"), default="auto",
        help="output over light (default: the one that explains the outputs better)",
    )  # fmt: skip
    parser.add_argument(
        "--holdout", type=number("a share from 0 to 0.8", lambda value: 0.0 <= value <= 0.8), default=0.25,
        metavar="SHARE", help="of the sunlight, at its end (default: %(default)s; 0: none)",
    )  # fmt: skip
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    return run_command(_parser(), arguments, "css_calibration.verbs.calibrate", "interrupted; no calibration written")
