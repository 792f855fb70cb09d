# SPDX-License-Identifier: Apache-2.0
"""The verbs of `./sunpoint`: thin names for executables of the ROS packages, and the help."""

from __future__ import annotations

from typing import NamedTuple

from bootstrap.environment import WITH_WHEELS

JOINING_OPTIONS = """\
  --flight NAME|PID  join this flight when several are running: its mission, recording or process
  --domain N         join this ROS domain
The ROS domain is that of --domain, --flight or ROS_DOMAIN_ID, else that of the running flight, else 0."""


class Verb(NamedTuple):
    """One verb; without a package it is done by the bootstrap itself.

    `ros`: it puts nodes on topics, or tests those, and is refused where there is no ROS.
    """

    summary: str
    package: str = ""
    executable: str = ""
    ros: bool = False


VERBS = {
    "demo": Verb(
        "fly one orbit, record it, replay it through four estimators, draw it", "css_bringup", "demo", ros=True
    ),
    "fly": Verb("fly a mission file, every node on real ROS 2 topics", "css_bringup", "fly", ros=True),
    "replay": Verb("step estimators over a recorded bag and compare", "css_bringup", "replay"),
    "hil": Verb(
        "fly a mission in real time with a board in the loop, over serial or UDP", "css_bringup", "hil", ros=True
    ),
    "bench": Verb(
        "measure the speed of the graph, and of the Monte Carlo beside Basilisk", "css_bringup", "bench", ros=True
    ),
    "record": Verb("record topics into an MCAP bag", "css_recording", "recorder", ros=True),
    "play": Verb("play a bag onto live topics", "css_recording", "player", ros=True),
    "recover": Verb("rebuild the bag of a recorder that was killed", "css_recording", "recover"),
    "import-csv": Verb("turn a table of measurements into a bag", "css_telemetry", "import_csv"),
    "calibrate": Verb("calibrate cells, magnetometer and gyro from a bag", "css_calibration", "calibrate"),
    "check": Verb("find the cells of a bag that lie", "css_calibration", "check"),
    "monte-carlo": Verb("fly thousands of cases of a mission in a compiled loop", "css_monte_carlo", "monte_carlo"),
    "report": Verb("one page of a flight or a study, for any browser", "css_report", "report"),
    "view": Verb("draw a bag in 3-D, for Foxglove, RViz, PlotJuggler and Rerun", "css_viewers", "view"),
    "coverage": Verb("map how well a cell layout sees the Sun", "css_monte_carlo", "coverage"),
    "new": Verb("write the mission of your own spacecraft: gains, gates and steps computed", "css_design", "new"),
    "layout": Verb("search where the cells should look: error against number of cells", "css_design", "layout"),
    "budget": Verb("split heading and pointing error by source: predicted, and measured", "css_design", "budget"),
    "reproduce": Verb("fly a paper's experiments and set its numbers beside ours", "css_papers", "reproduce"),
    "export": Verb("make C libraries for flight computers of a mission's kernels", "css_export", "export"),
    "slit-analyse": Verb("Sun angle, spin and coning from a file of slit pulses", "css_analysis", "slit_analyse"),
    "test": Verb("run the linters and the tests; FILE ...: those alone, -m long: the longest", ros=True),
    "lint": Verb("run ruff and mypy over everything"),
    "shell": Verb("open a shell with ros2, colcon and Python ready; -c COMMAND runs one command"),
}


JOINING = ("shell", "record", "play")


def help_text(machine: str = WITH_WHEELS) -> str:
    """What `./sunpoint --help` prints on a machine that `uname -sm` names so."""
    width = max(map(len, VERBS))
    table = "\n".join(f"  {name:{width}}  {verb.summary}" for name, verb in VERBS.items())
    return f"""Sunpoint: sun-sensing flight software on ROS 2 Jazzy. Simulated sun sensors, sun-heading
estimators, sun-pointing control, recording and replay, each a real ROS 2 node.

Quick start (the first command sets everything up inside this folder, once):
  ./sunpoint demo
  ./sunpoint shell        then: ros2 pkg executables css_estimation

Usage: ./sunpoint VERB [ARGUMENTS]
{table}

Missions are files in config/ or anywhere; one may extend another (`extends: OTHER`, see README.md).

A flight has a ROS domain for itself. shell, record and play join it; when several are running,
--flight NAME|PID or --domain N chooses.

./sunpoint VERB --help explains one verb, ./sunpoint --version says which version this is.{_without_ros(machine)}"""


def _without_ros(machine: str) -> str:
    if machine == WITH_WHEELS:
        return ""
    verbs = ", ".join(name for name, verb in VERBS.items() if verb.ros)
    return f"""

ROS 2 has no packages for {machine} that could be installed here. These verbs need a Jazzy installation
that is sourced before: {verbs}. The others do without."""


OWN_USAGE = {
    "test": """Usage: ./sunpoint test [PYTEST ARGUMENTS]

Runs pytest with message type checks on; without arguments ruff and mypy too, and fails if any of them does.
  ./sunpoint test                                  linters and all tests, on two processors (pytest -q -n 2 ...)
  ./sunpoint test tests/test_processes.py          these tests alone
  ./sunpoint test src/css_common/test -k attitude  some of those
All options: ./sunpoint shell -c 'pytest --help'""",
    "lint": """Usage: ./sunpoint lint

Runs ruff and mypy over everything, and fails if one of them does.""",
    "shell": f"""Usage: ./sunpoint shell [--flight NAME|PID | --domain N] [-c COMMAND | BASH ARGUMENTS]

Opens bash with the environment that the verbs run in: ros2, colcon, python and every built package.
With -c it runs one command and ends with its exit code. Message type checks are on; for timed runs
switch them off with ROS_PYTHON_CHECK_FIELDS=0.

{JOINING_OPTIONS}""",
}
"""Help of the verbs that have no executable to give it."""


def unknown_verb(name: str) -> str:
    """The message for a verb that does not exist, with the nearest one that does."""
    import difflib  # only a mistyped verb pays for this import

    near = difflib.get_close_matches(name, VERBS, n=1, cutoff=0.5)
    hint = f"did you mean '{near[0]}'?" if near else "./sunpoint --help lists the verbs"
    return f"sunpoint: unknown verb '{name}'; {hint}"
