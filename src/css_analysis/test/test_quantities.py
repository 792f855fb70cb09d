# SPDX-License-Identifier: Apache-2.0
"""The table of quantities, and what is written of it elsewhere."""

from pathlib import Path

from css_analysis.flight_metrics import Windows
from css_analysis.quantities import (
    QUANTITIES,
    attitude_quantities,
    attitude_summaries,
    flight_quantities,
    quantities,
    study_quantities,
    summaries,
)

README = Path(__file__).parents[1] / "README.md"
ALL = Windows(settled_time=300.0, late_time=300.0, report_time=3000.0, detumbled_rate_deg_s=3.0)


def readme_rows(table):
    """Lines of the README's table."""
    return [f"| {' '.join(filter(None, (f'`{q.name}`', q.unit and f'[{q.unit}]')))} | {q.description} |" for q in table]


def test_the_readme_has_the_rows_of_the_table():
    text = README.read_text(encoding="utf-8").partition("## Figures of merit")[2].partition("\n## ")[0]
    lines = [line for line in text.splitlines() if line.startswith("| `")]
    only_studies = [quantity for quantity in quantities(ALL) if quantity.measure is None]
    assert lines == [*readme_rows(QUANTITIES.values()), *readme_rows(only_studies)]


def test_names_and_columns_are_unique_and_every_quantity_comes_from_somewhere():
    table = quantities(ALL)
    assert all(quantity.measure or quantity.tally or quantity.attitude_tally for quantity in table)
    assert len({quantity.name for quantity in table}) == len(table)
    for of_cases, told in ((study_quantities, summaries), (attitude_quantities, attitude_summaries)):
        columns = [quantity.study_column for quantity in of_cases(ALL)]
        assert len(set(columns)) == len(columns)
        assert {summary.of for summary in told(ALL)} <= set(columns)


def test_what_a_mission_does_not_ask_for_is_not_there():
    asked = {quantity.name for quantity in quantities(ALL)} - {quantity.name for quantity in quantities(Windows())}
    safe_mode = {"detumbled_s", "power_positive_from_s", "power_positive_late", "rod_dipole_mean"}
    assert asked == {"heading_error_late_deg", "rate_50min_deg_s", "rate_knowledge_50min_deg_s"} | safe_mode
    assert set(QUANTITIES) == set(flight_quantities(Windows())) | safe_mode
    named = {summary.name for summary in summaries(Windows(report_time=1200.0))}
    assert {"rate_20min_deg_s", "rate_knowledge_20min_deg_s"} <= named


def test_each_quantity_is_explained_by_itself():
    """Tables show those that have a value: the one that another refers to may not stand above it."""
    table = (*quantities(ALL), *attitude_quantities(ALL))
    assert [q.name for q in table if "the same" in q.description] == []
