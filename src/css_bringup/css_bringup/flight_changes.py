# SPDX-License-Identifier: Apache-2.0
"""What changed at an estimator in flight, as far as a recording tells: scripted events, parameters set by others.

An event of the mission has its time. A parameter that somebody set in flight is on /parameter_events, but the step at
which the node took it is not recorded: only that the latest stamp was such and such when the recorder heard of it.
"""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from css_common.mission import Event
from css_common.schema import ParameterError, Table
from css_recording.parameter_events import RecordedSetting


class ParameterChange(NamedTuple):
    """Parameters of a node that were set in flight."""

    stamp_ns: int  # latest stamp when it was recorded: about when it took effect
    values: Mapping[str, Any]

    def text(self) -> str:
        """The values as KEY=VALUE."""
        return ", ".join(f"{key}={value}" for key, value in self.values.items())


def settings_in_flight(
    settings: Iterable[RecordedSetting], node: str, table: Table, scripted: Iterable[Event]
) -> list[ParameterChange]:
    """What was set at a node and is not the doing of its scripted events, which set parameters in the same way.

    Args:
        settings: messages of all nodes, in their order.
        node: name of the node.
        table: its parameters; others and values that they refuse are left out, as the node did.
        scripted: events of the mission.
    """
    specifications = {p.name: p for p in table}
    waiting = [(e.parameter, e.value) for e in scripted if e.node == node and e.action == "set"]
    changes = []
    for setting in settings:
        if setting.node != node:
            continue
        values = {}
        for name, value in setting.values.items():
            try:
                values[name] = specifications[name].check(list(value) if specifications[name].is_array else value)
            except (KeyError, ParameterError, TypeError):
                continue
        if len(values) == 1 and next(iter(values.items())) in waiting:
            waiting.remove(next(iter(values.items())))
        elif values:
            changes.append(ParameterChange(setting.stamp_ns, values))
    return changes
