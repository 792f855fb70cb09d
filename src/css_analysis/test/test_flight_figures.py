# SPDX-License-Identifier: Apache-2.0
"""Figures are written for whatever a flight holds, and long series keep their extremes."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib import image
from synthetic_flight import columns, estimates, stamps, tilted, truth

from css_analysis.figure_style import binned, colours
from css_analysis.flight_figures import write_figures
from css_analysis.flight_log import FlightLog
from css_analysis.flight_series import time_axis
from css_common.mission import load_mission
from css_msgs.msg import ControlStatus, CssVoltages, WheelState

STEPS = 3000
PANELS = ["heading_error", "pointing_error", "body_rate", "control_mode", "wheel_speed", "cell_output"]


def full_log(origin: str = "flights/one") -> FlightLog:
    pointing = 90.0 * np.exp(-np.arange(STEPS) / 300.0) + 5.0
    lit = np.where(np.arange(STEPS) < 2000, 1.0, 0.0)
    ekf = estimates(tilted(pointing + 1.0), rate_source=1)
    ekf.validity[:100] = 0
    return FlightLog(
        origin,
        truth=truth(pointing, lit),
        estimates={"ekf": ekf, "wavg": estimates(tilted(pointing + 5.0))},
        voltages=columns(CssVoltages, stamps(STEPS)),
        wheels=columns(WheelState, stamps(STEPS)),
        control=columns(ControlStatus, stamps(STEPS), mode=4),
    )


def is_picture(path: Path) -> bool:
    """True for a readable image that is not of one colour."""
    pixels = image.imread(path)
    return min(pixels.shape[:2]) > 200 and float(pixels[..., :3].std()) > 0.01


def test_a_flight_gives_an_overview_and_its_panels(tmp_path):
    files = write_figures(full_log(), tmp_path / "new" / "folder")
    assert [file.name for file in files] == ["overview.png", *(f"{name}.png" for name in PANELS)]
    assert all(is_picture(file) for file in files)


def test_equal_flights_give_equal_files(tmp_path):
    first = write_figures(full_log(), tmp_path / "a")[0]
    second = write_figures(full_log(), tmp_path / "b")[0]
    assert first.read_bytes() == second.read_bytes()


def test_several_flights_are_compared(tmp_path):
    logs = [full_log("a/one"), full_log("b/one"), full_log("two.mcap")]
    files = write_figures(logs, tmp_path)
    names = [str(file.relative_to(tmp_path)) for file in files]
    assert names[0] == "comparison.png" and is_picture(files[0])
    assert {name.split("/")[0] for name in names[1:]} == {"one_1", "one_2", "two"}
    assert len(files) == 1 + 3 * 7


@pytest.mark.parametrize(
    ("log", "expected"),
    [
        (FlightLog("nothing"), []),
        (FlightLog("foreign", estimates={"obc": estimates(tilted(np.zeros(50)))}), ["overview", "body_rate"]),
        (FlightLog("cells", voltages=columns(CssVoltages, stamps(1))), ["overview", "cell_output"]),
        (FlightLog("one step", truth=truth(np.zeros(1))), ["overview", "pointing_error", "body_rate"]),
    ],
)
def test_flights_that_lack_topics(log, expected, tmp_path):
    assert [file.stem for file in write_figures(log, tmp_path)] == expected


def test_an_estimator_that_never_estimates(tmp_path):
    log = full_log()
    log.estimates["ekf"].validity[:] = 0
    assert is_picture(write_figures(log, tmp_path)[1])


@pytest.mark.parametrize("begin_s", [0.0, 350.0, 5000.0])
@pytest.mark.parametrize(("length_s", "label", "scale"), [(599.0, "time [s]", 1.0), (601.0, "time [min]", 60.0)])
def test_time_is_in_minutes_when_a_flight_is_long_not_when_it_begins_late(begin_s, length_s, label, scale):
    late = stamps(1)[0] + (1e9 * np.array([begin_s, begin_s + length_s])).astype(np.int64)
    log = FlightLog("a part", mission=load_mission("okeefe_2013"), voltages=columns(CssVoltages, late))
    axis = time_axis(log)
    assert (axis.label, axis.scale) == (label, scale)
    assert (axis.first, axis.last) == pytest.approx((begin_s / scale, (begin_s + length_s) / scale))


def test_no_extreme_is_lost_and_gaps_stay():
    x = np.arange(1000.0)
    y = np.sin(x)
    y[137] = 50.0
    y[200:300] = np.nan
    at, low, middle, high = binned(x, y, 10)
    np.testing.assert_array_equal(at, x[::10])
    assert np.nanmax(high) == 50.0
    assert np.isnan(low[20:30]).all() and np.isnan(middle[20:30]).all() and not np.isnan(low[:20]).any()
    blocks = y[:130].reshape(13, 10)
    np.testing.assert_array_equal(low[:13], blocks.min(axis=1))
    np.testing.assert_array_equal(middle[:13], np.sort(blocks, axis=1)[:, 4])


def test_a_last_bin_that_is_not_full():
    _, low, _, high = binned(np.arange(25.0), np.arange(25.0), 10)
    np.testing.assert_array_equal(low, [0.0, 10.0, 20.0])
    np.testing.assert_array_equal(high, [9.0, 19.0, 24.0])


def test_every_line_has_a_colour_of_its_own():
    for count in (1, 8, 9, 32):
        assert len(set(colours(count))) == count
