# SPDX-License-Identifier: Apache-2.0
"""Lines about mode changes: each kind once, not more than one a minute, none forgotten."""

from typing import Any

import numpy as np
from clark_light import NORMALS, PANEL, off_panel, outputs

from css_common.codec import codec_of
from css_common.schema import checked_values, shaped_values
from css_estimation.nodes.pyramid_switch import PyramidSwitch
from css_estimation.sun.mode_log import ModeLog
from css_msgs.msg import CssVoltages

S = 1_000_000_000


def test_changes_are_named_and_those_within_a_minute_counted():
    log = ModeLog({1: "flat", 3: "pyramid"}, epoch_ns=100 * S)
    assert log.line(100 * S, 1) is None
    assert log.line(101 * S, 1) is None
    assert log.line(102 * S, 3) == "mode 'flat' -> 'pyramid' at 2 s"
    # nine changes within the minute, which end in the mode of the beginning
    assert [log.line((103 + k) * S, 1 + 2 * (k % 2)) for k in range(9)] == [None] * 9
    assert [log.line((120 + k) * S, 1) for k in range(42)] == [None] * 42
    assert log.line(162 * S, 1) == "mode 'pyramid' -> 'flat' at 11 s, after 8 other changes"
    assert log.line(163 * S, 1) is None
    assert log.line(300 * S, 7) == "mode 'flat' -> '7' at 200 s"


def test_the_estimator_reports_that_the_pyramid_was_adopted():
    table = PyramidSwitch.table()
    given = {
        "cells.normals": NORMALS.ravel().tolist(),
        "cells.clip_normal": [0.0, 0.0, 0.0],
        "spacecraft.array_normal": PANEL.tolist(),
        "mission.epoch": "2013-06-01T00:00:00Z",
    }
    component = PyramidSwitch("safe", shaped_values(table, checked_values(table, given)))
    lines: list[Any] = []
    component.report = lines.append
    for k, angle in enumerate((60.0, 40.0, 20.0, 0.0)):
        stamp_ns = component.epoch_ns + k * component.period_ns
        cells = codec_of(CssVoltages).sample(stamp_ns, "bus", voltages=np.array(outputs(off_panel(angle))))
        component.cycle(stamp_ns, {"cells": cells, "gyro": None})
    assert lines == ["mode 'flat cells' -> 'pyramid' at 0.2 s"]
