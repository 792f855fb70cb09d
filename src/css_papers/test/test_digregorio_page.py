# SPDX-License-Identifier: Apache-2.0
"""The page of DiGregorio & Crassidis, with few cases."""

from css_papers.digregorio.flights import DIODES
from css_papers.papers import Request, find_paper


def test_the_page_has_its_numbers_and_figures(tmp_path):
    rows = find_paper("digregorio").reproduce(Request(tmp_path, 4, True))
    by_name = {line.quantity: line for line in rows}
    for diodes in DIODES:
        assert by_name[f"{diodes}: cases that diverge"].ok
        assert by_name[f"{diodes}: voltage over vector"].ok
        assert 0.1 < by_name[f"{diodes}: mean error, voltage"].here < 0.5
    text = (tmp_path / "README.md").read_text(encoding="utf-8")
    for picture in ("case_0_six.png", "case_0_four.png", "error_over_cases.png"):
        assert picture in text and (tmp_path / picture).stat().st_size > 10_000
