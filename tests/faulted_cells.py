# SPDX-License-Identifier: Apache-2.0
"""Missions with a cell that fails, one kind at a time, and the names by which each kind may be called."""

from typing import Any, NamedTuple

from uncalibrated import MISSION as TUMBLE

from css_common.mission import Mission, load_mission, mission_from_text
from css_common.mission_file import dump_sections


class Fault(NamedTuple):
    """One entry of the section `faults`."""

    values: dict[str, Any]
    names: tuple[str, ...]  # verdicts that are right
    cells: tuple[int, ...] = (0,)


FAULTS = {
    "dead": Fault({}, ("dead",)),
    "stuck": Fault({"level": 0.4}, ("stuck",)),
    "frozen": Fault({}, ("frozen", "stuck", "dead")),
    "stuck_high": Fault({}, ("stuck high", "stuck")),
    "noisy": Fault({"sigma": 0.1}, ("noisy",)),
    "drifting": Fault({"rate": 0.0003}, ("drifting",)),
    "scaled": Fault({"factor": 0.5}, ("scaled",)),
    "bias": Fault({"offset": 0.3}, ("bias",)),
    "sign": Fault({}, ("sign", "dead")),
    "saturated": Fault({"limit": 0.5}, ("saturated",)),
    "spikes": Fault({"size": 0.6, "share": 0.1}, ("spikes",)),
    "intermittent": Fault({"share": 0.5, "spell": 60.0}, ("intermittent",)),
    "swapped": Fault({"other": 2.0}, ("swapped",), (0, 2)),
    "shadowed": Fault({"share": 0.6}, ("shadowed", "scaled")),
}

_OKEEFE = ["mission.duration=1500.0", "mission.period=0.2"]
MISSIONS = ("tumble", "okeefe_2013", "cubesat_vmm")
"""Uncalibrated cells in a tumble; the paper's acquisition and pointing; a cubesat's six faces in a tumble."""


def faulted(name: str, case: int, kind: str | None) -> Mission:
    """A mission of `MISSIONS` with a fault of `FAULTS` from a third of its duration on, or without."""
    errors = [f"mission.case={case}", "css_array.scale_cell_error=0.05", "css_array.misalignment_deg=1.0"]
    if name == "tumble":
        mission = mission_from_text(TUMBLE, name, errors)
    else:
        mission = load_mission(name, errors + (_OKEEFE if name == "okeefe_2013" else []))
    if kind is None:
        return mission
    fault = FAULTS[kind]
    entry = {"time": mission.values.mission.duration / 3.0, "target": "cell.0", "kind": kind, **fault.values}
    sections = {"/**": {f"faults.it.{key}": value for key, value in entry.items()}}
    text = dump_sections({name: dict(flat) for name, flat in mission.with_sections(sections).parameters.items()})
    return mission_from_text(text, name)
