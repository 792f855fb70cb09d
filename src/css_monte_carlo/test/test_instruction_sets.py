# SPDX-License-Identifier: Apache-2.0
"""A study has the same bytes whichever instructions the compiler may use."""

import os
import subprocess
import sys

from css_common.mission import load_mission
from css_monte_carlo.study import Configuration, run_study

PROGRAM = "import runpy, sys; runpy.run_path(sys.argv[1])['fly'](sys.argv[2])"
# no vector instructions but those that every x86-64 has, and nothing fused
PLAINEST = {"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": ""}


def fly(folder) -> None:
    # all of the flight but the health of sensors, which would be most of what has to be compiled twice
    mission = load_mission("okeefe_2013", ["mission.duration=600", "ekf.health.enabled=false"])
    run_study(mission, [Configuration("ekf", True)], 2, folder)


def test_code_for_the_plainest_processor_gives_the_same_bytes(tmp_path):
    command = [sys.executable, "-c", PROGRAM, __file__, str(tmp_path / "plainest")]
    plainest = subprocess.Popen(command, env=os.environ | PLAINEST)
    # here, where other studies have compiled most of it
    fly(tmp_path / "own")
    assert plainest.wait(timeout=240) == 0
    for file in ("cases.parquet", "percentiles.parquet"):
        assert (tmp_path / "own" / file).read_bytes() == (tmp_path / "plainest" / file).read_bytes()
