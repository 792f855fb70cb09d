# SPDX-License-Identifier: Apache-2.0
"""The second page: calibration errors and failures of cells, which O'Keefe & Schaub 2013 left as future work."""

from pathlib import Path

import pyarrow as pa

from css_papers.okeefe.configurations import SWEPT
from css_papers.okeefe.flights import merit
from css_papers.okeefe.sweep_figures import write_sweep
from css_papers.okeefe.sweeps import SWEEPS, Sweep, changed, sweep_configurations
from css_papers.page import Block, Page, Picture, Section, Table
from css_papers.rows import number

NAME = "calibration"
TITLE = "Calibration errors and failures of cells"


def calibration_page(cases: pa.Table, cases_each: int, folder: Path) -> Page:
    """Figures into the folder, and the page.

    Args:
        cases: of a study of `sweep_configurations`.
        cases_each: of each point.
    """
    merits = {c: merit(cases, c) for c in sweep_configurations()}
    sections = []
    for sweep in SWEEPS:
        file = write_sweep(sweep, SWEPT, merits, folder / f"{NAME}_{sweep.name}.png")
        blocks: list[Block] = [sweep.explanation, Picture(file.name, sweep.title), _table(sweep, merits)]
        sections.append(Section(sweep.title, blocks))
    lead = (
        f"What O'Keefe & Schaub 2013 left to future research, for each estimator with gyro and without: {cases_each} "
        "flights of one orbit for each point, with the paper's control, and the cells' other errors as everywhere. "
        "The estimators know nothing of the errors. Heading errors are means over the sunlit last five minutes."
    )
    return Page(TITLE, lead, sections)


def _table(sweep: Sweep, merits) -> Table:
    heading = ["heading error [deg] / time to power positive [min] / converged [%]"]
    heading += [label for _, label, _ in sweep.points]
    lines = []
    for entry in SWEPT:
        line = [entry.label]
        for _, _, change in sweep.points:
            m = merits[changed(entry.configuration, change)]
            values = (m.heading_error_late_deg, m.acquired_mean_min, m.converged_percent)
            line.append(" / ".join(map(number, values)))
        lines.append(line)
    return Table(heading, lines)
