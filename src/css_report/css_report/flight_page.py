# SPDX-License-Identifier: Apache-2.0
"""The page of a flight, or of two beside each other."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from css_analysis.estimator_runs import Run, estimator_runs
from css_analysis.faults_flown import NOTHING_FLOWN, FaultsFlown, faults_flown
from css_analysis.flight_log import FlightLog, read_flight
from css_analysis.flight_summary import criteria_verdicts, isolated_lines
from css_analysis.spin_flight import read_spinning
from css_analysis.spin_summary import spin_lines
from css_report.blocks import Block, Commands, Listing, Page, Section
from css_report.body_map import body_blocks
from css_report.cell_plots import cell_plots
from css_report.comparison import beside, merits_beside
from css_report.edges import Provenance, edge_blocks, provenance_of, topic_table, version_table
from css_report.flight_plots import LINKED, Scene, flight_plots, scene_of
from css_report.orbit_map import orbit_blocks
from css_report.tables import mapping_table, merit_table, verdict_table

_SUMMARY, _TIME, _BODY, _ORBIT, _EDGES, _MISSION = (
    "Summary",
    "Against time",
    "The Sun over the body",
    "Orbit and light",
    "Refused at the edges",
    "Mission and versions",
)


@dataclass
class Flight:
    """A flight as its page takes it.

    Attributes:
        log: its columns; estimates of a replay may stand beside those that flew.
        runs: figures of merit of its estimators.
        provenance: what its recording says of itself.
        flown: its faults, and what was found of them.
        remarks: what else is to be known of it, such as messages that a replay refused.
        spinning: lines about a payload that spins; none of others.
    """

    log: FlightLog
    runs: Sequence[Run]
    provenance: Provenance
    flown: FaultsFlown = NOTHING_FLOWN
    remarks: Sequence[str] = ()
    spinning: Sequence[str] = ()

    @property
    def name(self) -> str:
        """Where it comes from."""
        return Path(self.log.origin).name


def read_for_page(bag: Path) -> Flight:
    """A flight from its recording.

    Raises:
        BagError: it cannot be read.
    """
    log = read_flight(bag)
    spinning = read_spinning(bag)
    lines = () if spinning is None else spin_lines(spinning)
    return Flight(log, estimator_runs(log), provenance_of(bag), faults_flown(log, bag), spinning=lines)


def flight_page(flight: Flight, against: Flight | None = None) -> Page:
    """The page of one flight, or of two beside each other."""
    sections = _sections(flight, LINKED)
    if against is None:
        return Page(_title(flight), _lead(flight), sections)
    other = _sections(against, LINKED)
    names = (flight.name, against.name) if flight.name != against.name else (flight.log.origin, against.log.origin)
    both = merits_beside(names, (flight.runs, against.runs), flight.log, against.log)
    merged = [Section("Both", [both]), *beside(names, sections, other)]
    return Page(f"{names[0]} and {names[1]}", f"{_lead(flight)} Beside it: {_lead(against)}", merged)


def _title(flight: Flight) -> str:
    log = flight.log
    if log.mission is None:
        return log.name
    mission = log.mission.values.mission
    return f"{mission.name}, case {mission.case}"


def _lead(flight: Flight) -> str:
    log = flight.log
    seconds = max(float(log.time(columns)[-1]) for columns in log.columns())
    text = f"{log.origin}: stamps up to {seconds:.1f} s"
    if log.mission is not None:
        mission = log.mission.values.mission
        text = f"{mission.name}, case {mission.case}, seed {mission.seed}. {text}, from {mission.epoch} on"
        if mission.description:
            text = f"{mission.description}. {text}"
    if log.imported:
        text += "; imported telemetry: of arrays, orbit and shadow nothing is known"
    return f"{text}."


def _sections(flight: Flight, linked: str) -> list[Section]:
    scene = scene_of(flight.log, linked)
    parts: dict[str, list[Block]] = {
        _SUMMARY: _summary(flight),
        _TIME: [*flight_plots(scene), *cell_plots(scene)],
        _BODY: list(body_blocks(flight.log)),
        _ORBIT: _orbit(scene),
        _EDGES: list(edge_blocks(flight.log, flight.provenance, flight.remarks)),
        _MISSION: list(_mission(flight)),
    }
    return [Section(title, blocks) for title, blocks in parts.items() if blocks]


def _orbit(scene: Scene) -> list[Block]:
    try:
        return list(orbit_blocks(scene))
    except ValueError as error:  # a grid of reflectivities that is not on this machine
        return [f"The light of the Earth cannot be worked out again here: {error}"]


def _summary(flight: Flight) -> list[Block]:
    log = flight.log
    blocks: list[Block] = []
    if flight.runs:
        blocks.append(merit_table(log, flight.runs))
    else:
        blocks.append("No estimate was recorded: there is nothing to measure.")
    if log.truth is None:
        blocks.append("The recording has no truth: errors cannot be told.")
    blocks += [*isolated_lines(flight.runs), *flight.spinning]
    criteria = log.mission.criteria if log.mission is not None else {}
    if criteria:
        verdicts = criteria_verdicts(criteria, flight.runs)
        blocks.append(verdict_table(verdicts) if verdicts else "The mission has pass criteria; nothing was measured.")
    found = [detection.text() for detection in flight.flown.detections]
    if flight.flown.faults or found:
        blocks += ["Faults that acted, and what was found of them:", Listing([*flight.flown.faults, *found])]
    return blocks


def _mission(flight: Flight) -> Iterator[Block]:
    mission = flight.log.mission
    if mission is None:
        yield "The recording holds no mission that is valid here."
    else:
        if mission.nodes:
            yield mapping_table(
                ("node", "executable"), {node.name: f"{node.package}/{node.executable}" for node in mission.nodes}
            )
        if mission.events:
            yield mapping_table(
                ("scripted event", "what and when"),
                {
                    event.name: f"{event.time:g} s: {event.node} {event.action} {event.parameter} "
                    f"{'' if event.value is None else event.value}".strip()
                    for event in mission.events
                },
            )
        yield Commands([("The mission as it flew", mission.text().rstrip("\n"))])
    yield version_table(flight.provenance)
    yield topic_table(flight.provenance)
