# SPDX-License-Identifier: Apache-2.0
"""What the manoeuvre of the calibration mission tells of the cells, and what no manoeuvre could."""

from css_common.mission import Mission, load_mission
from css_common.stepping import Stepper
from css_estimation.nodes.sun_filter import SunFilter
from css_estimation.sun_filter.calibration_report import Calibrated
from css_monte_carlo.direct_flight import fly_and_keep
from css_papers.best.scenarios import CALIBRATION, FILTER
from css_papers.page import Listing, Section, Table
from css_papers.rows import number

_NOTES = (
    "observable: the flight has brought the error bar below half of what it was before",
    "gain of all cells: hardly, because the intensity of the light (`scale_sigma`) does the same to all outputs",
    "turn of all cells: a body that does not turn has them all tilted together or another attitude, no one could tell",
)


def calibration_section() -> Section:
    """The section of the page, of one case at the end of its manoeuvre."""
    heading = ["", "estimate", "1 sigma", "before", "unit", "observable"]
    lines = [
        [row.name, number(row.value), number(row.sigma), number(row.prior), row.unit, "yes" if row.observable else "no"]
        for row in calibrated_cells(load_mission(CALIBRATION))
    ]
    return Section("What the calibration tells of one case", [Table(heading, lines), Listing(_NOTES)])


def calibrated_cells(mission: Mission) -> list[Calibrated]:
    """What the Sun filter knows of its cells when the last scripted event of a mission is over."""
    end = max(event.time for event in mission.events) + mission.values.mission.period
    mission = mission.with_overrides([f"mission.duration={min(end, mission.values.mission.duration)}"])
    node = mission.node(FILTER)
    heard = fly_and_keep(mission, [given.topic for given in node.inputs])
    stepper = Stepper(node.component, node.name, node.canonical, mission.events, mission.epoch_ns)
    keys = [given.key for given in node.inputs]
    for samples in zip(*(heard[given.topic] for given in node.inputs), strict=True):
        stepper.step(samples[0].stamp_ns, dict(zip(keys, samples, strict=True)))
    component = stepper.component
    assert isinstance(component, SunFilter)  # of the mission
    return component.calibration()
