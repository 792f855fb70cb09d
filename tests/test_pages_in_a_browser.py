# SPDX-License-Identifier: Apache-2.0
"""Pages in a real browser: nothing is cut, overlaps, complains or is fetched, and plots zoom together."""

import sys

import pytest
from listing import ROOT
from page_flight import flight

from css_common.mission import load_mission
from css_report.blocks import Page, Section
from css_report.commands.report import main
from css_report.html_page import html_of

sys.path.insert(0, str(ROOT / "benchmarks"))

from browser import NAMES, browser_path
from page_checks import WIDTHS, linked_zoom, look_at

BROWSER = browser_path() or ""
pytestmark = pytest.mark.skipif(not BROWSER, reason=f"no browser on this machine, looked for {', '.join(NAMES)}")


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """Of a flight that has everything."""
    folder = tmp_path_factory.mktemp("pages")
    bag = flight(folder / "bag", load_mission("okeefe_2013").text())
    assert main([str(bag), "-o", str(folder / "page.html")]) == 0
    return folder / "page.html"


@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_is_cut_and_nothing_overlaps(page, width):
    seen = look_at(BROWSER, page, width, dark=width == min(WIDTHS))
    assert seen.plots == 17
    assert seen.faults == []


def test_faults_would_be_found(tmp_path):
    text = html_of(Page("Title", "Lead", [Section("Part", ["A text."])]))
    head = text.index("<h1>")
    broken = tmp_path / "broken.html"
    wrong = (
        '<p style="width:3000px;overflow-wrap:normal;white-space:nowrap">' + "wide " * 300 + "</p>"
        '<p style="margin-bottom:-2.5em">below</p><p>above</p><script>console.error("complaint")</script>'
    )
    broken.write_text(text[:head] + wrong + text[head:], encoding="utf-8")
    faults = "\n".join(look_at(BROWSER, broken, 800).faults)
    assert "the page is" in faults and "cut at the edge of the page: wide" in faults
    assert "below overlaps above" in faults and "console: complaint" in faults


def test_plots_of_a_flight_zoom_together(page):
    first, second = linked_zoom(BROWSER, page)
    assert first == second == [1.0, 2.0]
