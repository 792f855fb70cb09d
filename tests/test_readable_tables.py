# SPDX-License-Identifier: Apache-2.0
"""No number is cut in a console of any width, and no heading by a long name."""

import io
import re

import pytest
from rich.console import Console

from css_analysis.flight_metrics import Windows
from css_analysis.flight_summary import criteria_failures, criteria_verdicts, summary_table
from css_analysis.quantities import flight_quantities, summaries
from css_analysis.readable_table import ReadableTable
from css_common.mission import load_mission
from css_monte_carlo.study_tables import _study_table
from css_monte_carlo.verbs.coverage import _print_tables, study

WIDTHS = (12, 20, 40, 60, 80, 120)


def printed(thing, width):
    out = io.StringIO()
    Console(file=out, width=width, highlight=False).print(thing)
    return out.getvalue()


def run(estimator, first, **changes):
    """A run whose numbers all differ."""
    values = {quantity: first + 1.25 * i for i, quantity in enumerate(flight_quantities(Windows()))}
    fixed = {"estimator": estimator, "gyro": "on", "flown": False, "steps_without_estimate": int(first)}
    return values | fixed | changes


def table_of(rows):
    table = ReadableTable("numbers")
    table.add_name("name")
    for heading in ("con-\nverging\n[s]", "heading\nerror\nmean\n[deg]", "ratio"):
        table.add_number(heading)
    for row in rows:
        table.add_texts(row)
    return table


ROWS = [["wavg", "123456.1", "0.25", "-"], ["ekf:gyro=off,sigma_voltage=0.2", "7.5", "1234.75", "98.125"]]


@pytest.mark.parametrize("width", WIDTHS)
def test_every_number_is_whole(width):
    text = printed(table_of(ROWS), width)
    assert "…" not in text
    for number in ("123456.1", "0.25", "7.5", "1234.75", "98.125"):
        assert re.search(rf"(?<![\d.]){re.escape(number)}(?![\d.])", text), (number, text)
    joined = re.sub(r"\s", "", text)
    assert all(word in joined for word in ("verging", "heading", "ratio"))


@pytest.mark.parametrize("width", WIDTHS)
def test_no_line_is_wider_than_the_console(width):
    assert all(len(line.rstrip()) <= width for line in printed(table_of(ROWS), width).splitlines())


@pytest.mark.parametrize("width", [50, 60, 120])
def test_a_long_name_is_folded_and_not_lost(width):
    lines = printed(table_of(ROWS), width).splitlines()
    assert "heading" in "".join(lines) and "1234.75" in "".join(lines)
    left = [line.split()[0] for line in lines if line.strip() and line[1] != " "]
    assert "ekf:gyro=off,sigma_voltage=0.2" in "".join(left)


def test_too_narrow_for_the_numbers_each_row_is_a_block():
    lines = [line.strip() for line in printed(table_of(ROWS), 30).splitlines()]
    assert lines[0] == "numbers"
    at = lines.index("name: wavg")
    assert lines[at + 1 : at + 4] == ["converging [s]: 123456.1", "heading error mean [deg]: 0.25", "ratio: -"]


@pytest.mark.parametrize("width", [40, 80])
def test_summary_of_a_flight(width):
    runs = [run("ekf", 100.0, flown=True), run("attitude_filter_with_a_long_name:gyro=off", 2000.0)]
    text = printed(summary_table(runs, "a flight"), width)
    assert "…" not in text
    for first in (100.0, 2000.0):
        for i, quantity in enumerate(flight_quantities(Windows())):
            if flight_quantities(Windows())[quantity].heading and quantity != "steps_without_estimate":
                assert f"{first + 1.25 * i:.2f}"[:5] in text, (quantity, text)
    assert all(len(line.rstrip()) <= width for line in text.splitlines())


@pytest.mark.parametrize("width", [40, 80])
def test_coverage(width):
    result, _ = study(load_mission("okeefe_2013"))
    out = io.StringIO()
    _print_tables(result, Console(file=out, width=width, highlight=False))
    text = out.getvalue()
    assert "…" not in text
    for part in result["seen_by_fraction"]:
        assert f"{100.0 * part:.2f}" in text
    for key in ("wavg_ideal", "wavg_warped"):
        low, high = result[key]["polar_max_above_30"]
        assert f"{low:.1f} to {high:.1f}" in text
        assert f"{result[key]['max_within_deg']['19']:.2f}" in text


def configuration(estimator, gyro, scale, first):
    keys: tuple[str, ...] = (
        "heading_error_mean_deg",
        "heading_error_p95_deg",
        "heading_error_eclipse_deg",
        "power_positive_fraction",
        "converging_mean_s",
    )
    keys += ("converging_max_s", "rate_50min_deg_s", "rate_knowledge_50min_deg_s")
    overrides = [f"css_array.scale_cell_error={scale}", "css_array.noise=0.5"]
    figures = {key: first + i for i, key in enumerate(keys)}
    interval = {key: (None, None) for key in keys}
    return {"estimator": estimator, "gyro": gyro, "overrides": overrides, "interval_95": interval, **figures}


COLUMNS = summaries(Windows(report_time=3000.0))
ORDER = [(0, "wavg"), (0, "ekf"), (0.1, "wavg"), (0.1, "ekf"), (0.25, "wavg"), (0.25, "ekf")]
SWEEP = [configuration(name, "on", scale, 1000.0 * i) for i, (scale, name) in enumerate(ORDER)]


def test_a_sweep_is_one_table_with_the_values_below_each_other():
    lines = printed(_study_table(SWEEP, COLUMNS), 120).splitlines()
    rows = [line.split()[:5] for line in lines if line.split()[:1] in (["wavg"], ["ekf"])]
    assert rows == [
        ["wavg", "on", "0", "0.5", "0.00"],
        ["wavg", "on", "0.1", "0.5", "2000.00"],
        ["wavg", "on", "0.25", "0.5", "4000.00"],
        ["ekf", "on", "0", "0.5", "1000.00"],
        ["ekf", "on", "0.1", "0.5", "3000.00"],
        ["ekf", "on", "0.25", "0.5", "5000.00"],
    ]
    assert "css_array.scale_cell_error: 0.25" in printed(_study_table(SWEEP, COLUMNS), 40)


@pytest.mark.parametrize("width", [40, 80])
def test_a_sweep_in_a_narrow_console(width):
    text = printed(_study_table(SWEEP, COLUMNS), width)
    assert "…" not in text
    for i in range(len(SWEEP)):
        assert f"{1000.0 * i + 6:.3f}" in text and f"{1000.0 * i + 1:.2f}" in text


CRITERIA = {"heading_error_mean_deg": {"max": 102.0}, "rate_final_deg_s": {"min": 5.0, "max": 7.0}}


def test_every_criterion_has_its_verdict_with_value_and_limit():
    flown = run("ekf", 100.0, flown=True, rate_final_deg_s=7.5)
    verdicts = criteria_verdicts(CRITERIA, [flown, run("wavg", 500.0)])
    assert [verdict.line() for verdict in verdicts] == [
        "PASS  heading_error_mean_deg 101.25, must be at most 102  (ekf)",
        "PASS  rate_final_deg_s 7.5, must be at least 5  (ekf)",
        "FAIL  rate_final_deg_s 7.5, must be at most 7  (ekf)",
    ]
    (missed,) = criteria_failures(CRITERIA, [flown])
    assert missed == "ekf: rate_final_deg_s is 7.5, above criteria.rate_final_deg_s.max 7"


def test_without_a_value_no_criterion_is_met():
    missing = run("ekf", 1.0, flown=True, rate_final_deg_s=None)
    lines = [verdict.line() for verdict in criteria_verdicts(CRITERIA, [missing])]
    assert lines[1:] == [
        "FAIL  rate_final_deg_s no value, must be at least 5  (ekf)",
        "FAIL  rate_final_deg_s no value, must be at most 7  (ekf)",
    ]
    assert len(criteria_failures(CRITERIA, [missing])) == 1
