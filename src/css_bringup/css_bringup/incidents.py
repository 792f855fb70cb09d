# SPDX-License-Identifier: Apache-2.0
"""What was not as it should be in a flight, in one line each, from what nodes and recorder counted."""

from collections.abc import Iterator, Mapping

from css_common.edge import REJECTED, STRANGER
from css_common.mission import Mission
from css_drivers import hil_exchange

Counters = Mapping[str, int | float]

_OF_ANY_NODE = {
    "cycle_failed": "{} cycles failed and gave no output",
    "withheld_not_finite": "{} messages withheld because they were not finite",
    "events_refused": "{} scripted events refused",
    "deadline_missed": "{} cycles without an optional input that was silent",
    "time_set_back": "began anew {} times because time was set back",
    "skipped": "{} cycles that there were not, because a message that they need did not come",
    "unmatched": "{} messages that no cycle used, because what belongs to them did not come",
    hil_exchange.LOST: "{} frames that the board did not answer in time; its actuators had the safe command",
    hil_exchange.DOWN: "{} cycles without a link to the board",
    hil_exchange.LATE: "{} answers of the board that came after their cycle",
    hil_exchange.CORRUPT: "{} frames of the board that were damaged",
    hil_exchange.WRONG: "{} frames of the board that answer nothing that was asked, or for other actuators",
}
_OF_THE_PLANT = {
    "cycle_failed": _OF_ANY_NODE["cycle_failed"],
    "withheld_not_finite": _OF_ANY_NODE["withheld_not_finite"],
    "events_refused": _OF_ANY_NODE["events_refused"],
    "time_held": "simulated time held {} times, waiting for a partner",
    "partners_lost": "{} partners silent beyond the limit; the flight went on without them",
    "malformed_answers": "{} answers that are no message",
}
_READINGS = (".missing", ".impossible")


def node_incidents(mission: Mission, counters: Mapping[str, Counters]) -> list[str]:
    """What the nodes of a flight counted that should not have been.

    Args:
        mission: what flew.
        counters: of each node by name, as its health gives them.
    """
    plant = mission.plant.name if mission.plant is not None else ""
    lines: list[str] = []
    for name, counted in counters.items():
        meanings = _OF_THE_PLANT if name == plant else _OF_ANY_NODE
        lines += [f"{name}: {text.format(counted[key])}" for key, text in meanings.items() if counted.get(key)]
        lines += _at_the_edge(name, counted)
    return lines


def _at_the_edge(name: str, counted: Counters) -> Iterator[str]:
    for key, count in counted.items():
        if not count:
            continue
        source, rejected, kind = key.partition(REJECTED)
        if rejected:
            yield f"{name}: {count} messages of {source} refused ({kind})"
        if key.endswith(_READINGS):
            yield f"{name}: {count} readings counted as missing ({key})"
        topic, stranger, node = key.partition(STRANGER)
        if stranger:
            yield f"{name}: {count} messages of {node} on {topic} left out, which another node writes"


def lost_messages(mission: Mission, steps: int, recorded: Mapping[str, int]) -> dict[str, int]:
    """Messages that the cycles flown must have produced and a recording lacks, by topic.

    Topics of a node that the mission itself stops for a while are left out, and so are those of which any number may
    come in a step.

    Args:
        mission: what flew.
        steps: control cycles flown.
        recorded: messages recorded, by absolute topic name.
    """
    stopped = {event.node for event in mission.events if event.action == "deactivate"}
    lost: dict[str, int] = {}
    for topic, output in mission.outputs.items():
        if output.events or mission.publishers[topic] in stopped:
            continue
        missing = -(-steps // output.divider) - recorded.get(f"/{topic}", 0)
        if missing > 0:
            lost[f"/{topic}"] = missing
    return lost
