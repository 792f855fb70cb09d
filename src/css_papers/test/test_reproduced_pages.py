# SPDX-License-Identifier: Apache-2.0
"""Rows judge numbers as they should, pages say the same in HTML and in Markdown."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from page_reader import read

from css_analysis.figure_style import keep_figures, new_figure, save, style
from css_papers.errors import ReproductionError
from css_papers.page import Link, Listing, Page, Picture, Section, Table, write_page
from css_papers.paper_names import paper_names
from css_papers.papers import find_paper
from css_papers.rows import MISSES, Must, notes_of, number, row, row_object, table_of

ROWS = [
    row("error", "deg", 2.0, 1.5, Must(None, 2.0), relation="<", note="less <noise> & more"),
    row("error", "deg", 2.0, 2.5, Must(None, 2.0), relation="<", variant="improved"),
    row("rate", "deg/s", None, None, Must(0.1, 0.2), relation="noise level"),
    row("time", "min", 3.0, 12.345),
]


@given(st.floats(allow_nan=True), st.none() | st.floats(-1e3, 1e3), st.none() | st.floats(-1e3, 1e3))
def test_a_row_is_ok_when_its_number_is_in_the_range(value, low, high):
    line = row("q", "-", None, value, Must(low, high))
    finite = value == value and abs(value) != float("inf")
    inside = finite and (low is None or low <= value) and (high is None or value <= high)
    assert line.ok is inside
    assert (line.here is None) is not finite
    json.dumps(row_object(line), allow_nan=False)


def test_without_a_must_a_number_is_enough():
    assert row("q", "-", None, 1.0).ok and not row("q", "-", None, None).ok


@pytest.mark.parametrize(
    ("must", "text"), [(Must(1.0), "at least 1"), (Must(None, 0.016), "at most 0.016"), (Must(4.0, 7.5), "4 to 7.5")]
)
def test_a_must_reads_as_words(must, text):
    assert str(must) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "-"),
        (0.0, "0"),
        (4.9349, "4.93"),
        (99.96, "100"),
        (1234.6, "1235"),
        (0.001234, "0.00123"),
        (-9.993, "-9.99"),
    ],
)
def test_numbers_have_three_digits(value, text):
    assert number(value) == text


def test_rows_as_plain_data():
    first, better, rate, _ = map(row_object, ROWS)
    assert first == {"quantity": "error", "unit": "deg", "paper": 2.0, "here": 1.5, "must": "at most 2", "ok": True}
    assert better["quantity"] == "error, improved" and better["ok"] is False
    assert rate["here"] is None and rate["ok"] is False


def test_variants_share_a_line_of_the_table():
    heading, lines = table_of(ROWS)
    assert heading == ["quantity", "unit", "paper", "here", "must", "improved", "must"]
    assert lines[0] == ["error", "deg", "< 2", "1.5", "at most 2", f"2.5 {MISSES}", "at most 2"]
    assert lines[1] == ["rate", "deg/s", "noise level", f"- {MISSES}", "0.1 to 0.2", "", ""]
    assert lines[2][3:5] == ["12.3", ""]
    assert notes_of(ROWS) == ["error: less <noise> & more"]


def test_both_forms_of_a_page_say_the_same(tmp_path):
    heading, lines = table_of(ROWS)
    blocks: list[str | Table | Listing | Picture | Link] = [
        "A | bar & <angles>",
        Table(heading, lines),
        Listing(notes_of(ROWS)),
        Picture("a.png", "A picture"),
        Link("more", "More"),
    ]
    files = write_page(Page("Title", "Lead", [Section("Part", blocks)]), tmp_path)
    assert [file.name for file in files] == ["index.html", "README.md"]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["README.md", "index.html"]
    reader = read(files[0].read_text(encoding="utf-8"))
    assert reader.outside == ["a.png", "more.html"]
    assert reader.cells == [*heading, *(cell for line in lines for cell in line)]
    markdown = files[1].read_text(encoding="utf-8")
    drawn = [line for line in markdown.splitlines() if line.startswith("| ")]
    table = [[cell.strip() for cell in line.strip("|").split("|")] for line in drawn]
    assert table[0] == heading and table[2:] == lines
    assert len({len(line) for line in drawn}) == 1
    assert "![A picture](a.png)" in markdown and "[More](more.md)" in markdown and "- error: less" in markdown


def test_figures_that_are_kept_can_be_zoomed(tmp_path):
    with style(), keep_figures():
        figure = new_figure(4.0, 3.0)
        axes = figure.subplots()
        axes.set_title("Errors")
        axes.plot([0.0, 1.0, 2.0], [3.0, 5.0, 4.0], label="mean")
        axes.set_xlabel("time [s]")
        axes.set_ylabel("angle [deg]")
        save(figure, tmp_path / "figure_6.png")
        blocks = [Picture("figure_6.png", "Figure 6. Errors."), Picture("other.png", "No figure.")]
        html, markdown = write_page(Page("Title", "Lead", [Section("Part", blocks)]), tmp_path)
    page = read(html.read_text(encoding="utf-8"))
    assert page.trace("figure-6-1", "mean")["y"].tolist() == [3.0, 5.0, 4.0]
    assert page.outside == ["other.png"] and "Figure 6. Errors." in page.texts
    assert "![Figure 6. Errors.](figure_6.png)" in markdown.read_text(encoding="utf-8")


def test_papers_are_the_packages_of_the_folder():
    assert "okeefe" in paper_names() and "papers" not in paper_names()
    assert "AAS 13-891" in find_paper("okeefe").title
    with pytest.raises(ReproductionError, match="did you mean okeefe"):
        find_paper("okeffe")
