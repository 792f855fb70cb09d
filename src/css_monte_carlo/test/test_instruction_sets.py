# SPDX-License-Identifier: Apache-2.0
"""A study has the same bytes whichever instructions the compiler may use."""

import os
import subprocess
import sys

PROGRAM = """
import sys
from css_common.mission import load_mission
from css_monte_carlo.study import Configuration, run_study
mission = load_mission("okeefe_2013", ["mission.duration=600"])
run_study(mission, [Configuration("ekf", True)], 2, sys.argv[1])
"""
# no vector instructions but those that every x86-64 has, and nothing fused
PLAINEST = {"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": ""}


def test_code_for_the_plainest_processor_gives_the_same_bytes(tmp_path):
    # side by side: each compiles everything, with an empty cache
    studies = [
        subprocess.Popen([sys.executable, "-c", PROGRAM, str(tmp_path / name)], env=os.environ | instructions)
        for name, instructions in (("own", {}), ("plainest", PLAINEST))
    ]
    assert [study.wait(timeout=240) for study in studies] == [0, 0]
    for file in ("cases.parquet", "percentiles.parquet"):
        assert (tmp_path / "own" / file).read_bytes() == (tmp_path / "plainest" / file).read_bytes()
