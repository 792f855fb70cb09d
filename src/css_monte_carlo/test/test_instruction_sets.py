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


BITS = """
import hashlib, sys
import numpy as np
from css_common.mission import load_mission
from css_monte_carlo.direct_flight import fly_checked

for name in sys.argv[1:]:
    log, bits = fly_checked(load_mission(name, ["mission.duration=30", "mission.case=3"])), hashlib.sha256()
    for columns in (log.truth, log.voltages, log.wheels, *log.estimates.values(), *log.attitudes.values()):
        for values in vars(columns).values() if columns is not None else ():
            bits.update(np.ascontiguousarray(values).tobytes() if isinstance(values, np.ndarray) else b"")
    print(name, bits.hexdigest())
"""


def test_linear_algebra_of_another_processor_gives_the_same_flights():
    """OpenBLAS takes the kernels of the processor it finds, with other last bits; one that lacks those gets others."""
    missions = ("okeefe_2013", "esprit_2006", "cubesat_3u_sun_filter")
    told = [
        subprocess.run(
            [sys.executable, "-c", BITS, *missions],
            env=os.environ | {"OPENBLAS_CORETYPE": kernels},
            capture_output=True,
            text=True,
            timeout=240,
            check=True,
        ).stdout.splitlines()
        for kernels in ("Haswell", "SkylakeX")
    ]
    assert len(told[0]) == len(missions)
    assert told[0] == told[1]
