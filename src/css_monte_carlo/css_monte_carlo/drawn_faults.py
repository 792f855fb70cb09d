# SPDX-License-Identifier: Apache-2.0
"""The faults that the cases of a study have: as its mission says, with what is drawn for each of them."""

from collections.abc import Iterator

import numpy as np
import pyarrow as pa

from css_analysis.fault_record import case_record, fault_texts
from css_common.case_faults import CaseFault
from css_common.fault_lines import FAULTS
from css_common.mission import Mission
from css_common.mission_node import Node
from css_common.mission_section import PERIOD
from css_common.random_streams import RandomKey, random_key
from css_monte_carlo.case_missions import case_mission
from css_sim import cell_faults, faults
from css_sim.nodes.css_array import CssArray

COLUMN = "faults"


def has_faults(mission: Mission) -> bool:
    """Whether some of its cases may have a fault."""
    key = random_key(0, 0)
    return any(_faults_of(node, key) for node in mission.nodes)


def fault_column(mission: Mission, numbers: np.ndarray) -> pa.Array:
    """The faults of cases (C,) that begin in their flight, a list of lines each, as a flight's last lines have them.

    Faults that scripted events set are not drawn, and not in it.
    """
    seed = mission.values.mission.seed
    flown = (_flown(mission, int(number)) for number in numbers)
    lines = [list(_texts(flies, random_key(seed, own))) for flies, own in flown]
    return pa.array(lines, pa.list_(pa.string()))


def _flown(mission: Mission, number: int) -> tuple[Mission, int]:
    """The mission of a case, and the case whose draws it flies."""
    if not mission.dispersions:
        return mission, number
    flies = case_mission(mission, number)
    return flies, flies.values.mission.case


def _texts(mission: Mission, key: RandomKey) -> Iterator[str]:
    for node in mission.nodes:
        found = [fault for fault in _faults_of(node, key) if fault.first_step < mission.steps]
        yield from fault_texts([case_record(fault, node.values[PERIOD], node.host.units) for fault in found])


def _faults_of(node: Node, key: RandomKey) -> list[CaseFault]:
    kind, values = node.component, node.values
    if kind is CssArray:
        return cell_faults.case_faults(values, key)  # with those that are drawn without a line
    if not kind.fault_kinds:
        return []
    return faults.of_case(kind.fault_kinds, kind.fault_units(values), key, values[PERIOD]).of(values[FAULTS])
