# SPDX-License-Identifier: Apache-2.0
"""Tables of telemetry in many forms, imported by the command and replayed: the Sun is where the table has it."""

import math

import numpy as np
import pytest
from flights import samples

from css_bringup.replay_bag import mission_of_bag, replay
from css_bringup.replay_pass import parse_request
from css_msgs.msg import SpacecraftState, SunEstimate
from css_telemetry.commands.import_csv import main

CELLS = {
    "css_px": (1, 0, 0), "css_mx": (-1, 0, 0), "css_py": (0, 1, 0),
    "css_my": (0, -1, 0), "css_pz": (0, 0, 1), "css_mz": (0, 0, -1),
}  # fmt: skip
LAYOUT = "cells:\n" + "".join(f"  {name}: {list(n)}\n" for name, n in CELLS.items()) + "field_of_view_deg: 180\n"
COLUMNS = ["time", *CELLS, "omega_x_deg_s", "omega_y_deg_s", "omega_z_deg_s", "sun_x", "sun_y", "sun_z"]
BEGIN = 1_700_000_000
# without the light of the Earth every lit cell sees the Sun
ESTIMATORS = {name: parse_request(f"{name}:gate=0,minimum_output=0") for name in ("ekf", "wls")}


def rows(scale=1.0, dark=0.0):
    """Six faces of a cubesat that turns about z at 1 deg/s, the Sun 30 deg up; 120 lines, one a second."""
    for second in range(120):
        angle, height = math.radians(second), math.radians(30.0)
        sun = (math.cos(height) * math.cos(angle), -math.cos(height) * math.sin(angle), math.sin(height))
        cells = [dark + scale * max(0.0, float(np.dot(normal, sun))) for normal in CELLS.values()]
        yield [BEGIN + second, *cells, 0.0, 0.0, 1.0, *sun]


def text(lines, columns=COLUMNS, separator=","):
    return "\n".join([separator.join(columns), *(separator.join(map(str, line)) for line in lines)]) + "\n"


def set_back():
    for number, (time, *rest) in enumerate(rows()):
        yield [time + 3600 * (number < 20), *rest]


def far_ahead():
    for number, (time, *rest) in enumerate(rows()):
        yield [2_000_000_000 if number == 9 else time, *rest]


FORMS = {
    "plain": (text(rows()), [], LAYOUT, 120),
    "decimal commas": (text(rows(), separator=";").replace(".", ","), [], LAYOUT, 120),
    "blanks": (text(rows(), separator="  "), [], LAYOUT, 120),
    "milliseconds": (text([1000 * time, *rest] for time, *rest in rows()), ["--time-unit", "ms"], LAYOUT, 120),
    "dps": (text(rows(), [name.replace("deg_s", "dps") for name in COLUMNS]), [], LAYOUT, 120),
    "milliamperes": (text(rows(0.0025)), ["--full-scale", "0.0025"], LAYOUT, 120),
    "counts": (text(rows(3000.0, 100.0)), [], LAYOUT + "full_scale: 3000\ndark_level: 100\n", 120),
    "clock set back": (text(set_back()), ["--skip-bad"], LAYOUT, 100),
    "one time far ahead": (text(far_ahead()), ["--skip-bad"], LAYOUT, 119),
}


@pytest.mark.parametrize("form", FORMS)
def test_the_sun_is_where_the_table_has_it(form, tmp_path, capsys):
    content, options, cells, used = FORMS[form]
    (tmp_path / "table.csv").write_text(content)
    (tmp_path / "layout.yaml").write_text(cells)
    bag, out = tmp_path / "bag", tmp_path / "replay"
    assert main([str(tmp_path / "table.csv"), str(tmp_path / "layout.yaml"), "-o", str(bag), *options]) == 0
    assert f"120 read, {used} used, {120 - used} refused" in capsys.readouterr().out
    result = replay(bag, out, mission_of_bag(bag, {}, [], None), list(ESTIMATORS.values()), {})
    truth = {sample.stamp_ns: sample.sun_n for sample in samples(bag, "/truth", SpacecraftState)}
    assert len(truth) == used
    assert len(result.replayed) == len(ESTIMATORS)
    for run in result.replayed:
        estimates = samples(out, f"/{run.label}/sun_estimate", SunEstimate)
        assert len(estimates) == used
        worst = max(math.degrees(np.linalg.norm(np.cross(e.sun_b, truth[e.stamp_ns]))) for e in estimates)
        assert worst < 1e-4, run.label
        assert all(e.validity == SunEstimate.VALIDITY_VALID for e in estimates)
