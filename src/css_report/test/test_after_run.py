# SPDX-License-Identifier: Apache-2.0
"""What runs end with: a page that is named, or the reason why there is none; and what opens it."""

import webbrowser

import pytest
from synthetic_flight import estimates, record, tilted

from css_msgs.msg import SunEstimate
from css_report.after_run import write_page_after
from css_report.blocks import Beside, Block, Commands, Link, Listing, Page, Picture, Plot, Section, Table
from css_report.commands.report import main
from css_report.html_page import html_of
from css_report.places import page_of

PAGE = Page("Title", "Lead", [Section("Part", ["A text."])])


@pytest.fixture
def bag(tmp_path):
    topics = {"/x/sun_estimate": (SunEstimate, estimates(tilted([20.0] * 50)))}
    return record(tmp_path / "flight", topics)


def test_a_page_is_written_and_named(tmp_path, capsys):
    assert write_page_after("fly", lambda: PAGE, tmp_path / "a.html") == tmp_path / "a.html"
    assert capsys.readouterr().out == f"page: {tmp_path / 'a.html'}\n"
    assert [file.name for file in tmp_path.iterdir()] == ["a.html"]


def test_a_page_that_cannot_be_written_is_said(tmp_path, capsys):
    (tmp_path / "taken").write_text("no folder")
    assert write_page_after("fly", lambda: PAGE, tmp_path / "taken" / "a.html") is None
    told = capsys.readouterr()
    (line,) = told.err.splitlines()
    assert line.startswith("fly: error: ") and "the page cannot be written" in line and told.out == ""


def test_pages_lie_beside_what_they_show(tmp_path):
    (tmp_path / "bags").mkdir()
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "study.json").write_text("{}")
    assert page_of(tmp_path / "bags" / "one") == tmp_path / "bags" / "one.html"
    assert page_of(tmp_path / "study") == tmp_path / "study" / "report.html"
    against = page_of(tmp_path / "bags" / "one", tmp_path / "bags" / "two")
    assert against == tmp_path / "bags" / "one_against_two.html"


@pytest.mark.parametrize(("opens", "code"), [(True, 0), (False, 1)])
def test_a_browser_is_started_or_the_exit_code_says_that_none_is(bag, monkeypatch, capsys, opens, code):
    asked: list[str] = []

    def started(address: str) -> bool:
        asked.append(address)
        return opens

    monkeypatch.setattr(webbrowser, "open", started)
    assert main([str(bag), "--open"]) == code
    assert asked == [bag.with_suffix(".html").absolute().as_uri()]
    assert ("no browser could be started" in capsys.readouterr().err) is not opens


def test_every_block_has_a_form():
    blocks: list[Block] = [
        "text <b>",
        Listing(["one", "two"]),
        Commands([("what", "./sunpoint fly 'a b'")]),
        Table(["a", "b", "c"], [["1", "2", "3 (misses)"]]),
        Picture("p.png", "caption"),
        Link("more", "More"),
        Plot("same", "A plot", []),
        Plot("same", "Another", []),
        Beside(("left", "right"), (["ours"], ["theirs"])),
    ]
    text = html_of(Page("T", "L", [Section("S", blocks)]))
    assert "text &lt;b&gt;" in text and "<li>two</li>" in text and "./sunpoint fly &#x27;a b&#x27;" in text
    assert '<td class="misses" data-of="c">' in text and '<img src="p.png"' in text and 'href="more.html"' in text
    assert 'id="same"' in text and 'id="same-2"' in text and text.index("ours") < text.index("theirs")


def test_a_page_without_plots_is_small():
    assert len(html_of(PAGE)) < 30_000
