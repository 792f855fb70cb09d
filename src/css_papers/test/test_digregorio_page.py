# SPDX-License-Identifier: Apache-2.0
"""The page of DiGregorio & Crassidis, with few cases."""

import pytest
from presence import present

from css_common.mission import load_mission
from css_papers.digregorio import robustness
from css_papers.digregorio.flights import DIODES, FILTERS, MISSION
from css_papers.papers import Request, find_paper


def test_the_page_has_its_numbers_and_figures(tmp_path):
    rows = find_paper("digregorio").reproduce(Request(tmp_path, 4, True))
    by_name = {line.quantity: line for line in rows}
    for diodes in DIODES:
        assert by_name[f"{diodes}: cases that diverge"].ok
        assert by_name[f"{diodes}: voltage over vector"].ok
        assert 0.1 < present(by_name[f"{diodes}: mean error, voltage"].here) < 0.5
    text = (tmp_path / "README.md").read_text(encoding="utf-8")
    for picture in ("case_0_six.png", "case_0_four.png", "error_over_cases.png"):
        assert picture in text and (tmp_path / picture).stat().st_size > 10_000


def test_filters_are_judged_in_another_world(monkeypatch):
    monkeypatch.setattr(robustness, "_HOURS", range(0, 24, 12))
    told = []
    judged = robustness.judge(load_mission(MISSION), "1.5 times as bright", 2, lambda *done: told.append(done))
    assert told == [(1, 2), (2, 2)]
    assert set(judged) == {(name, errors) for name in FILTERS for errors in ("lasting", "white")}
    for name in FILTERS:
        lasting, white = judged[name, "lasting"], judged[name, "white"]
        assert lasting.mean < 0.3 < white.mean
        assert lasting.nees == pytest.approx(3.0, rel=0.4) and white.nees > 6.0
        assert lasting.mean < lasting.largest < white.largest
