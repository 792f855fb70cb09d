# SPDX-License-Identifier: Apache-2.0
"""Throws rubbish at what a flight takes in: messages, parameters, requests for faults, and missions with faults.

Each must be taken, or refused in one line, by a node that works on: no exception may pass, nothing that goes out may
hold NaN or infinity, and a refusal changes nothing. Missions and recordings in general have programs of their own,
`mutated_missions.py` and `damaged_bags.py`. The last line is one JSON object; the exit code is 1 when anything failed.

    python benchmarks/fuzz.py --count 20000 --seed 1
"""

import argparse
import json
import random
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from mutated_missions import STEPS, WORDS, first_not_finite, other_value
from rclpy.parameter import Parameter as RosParameter

from css_bringup.fly_mission import own_domain
from css_bringup.options import console
from css_common.codec import Sample, codec_of
from css_common.component import Component, Input, Plant
from css_common.edge import Edge
from css_common.fault_lines import FaultKind
from css_common.host import ComponentNode
from css_common.link import GAP
from css_common.matching import Matcher
from css_common.mission import Mission, load_mission, mission_from_text
from css_common.mission_file import MissionError
from css_common.schema import shown
from css_common.stepping import Stepper
from css_common.testing import Bench
from css_msgs.srv import ClearFault, InjectFault
from css_sim.nodes.slit_sensor import SlitSensor

CONFIG = Path(__file__).resolve().parents[1] / "config"
_NUMBERS = (0.0, -0.0, 1.0, -1.0, 0.5, 1e-300, 1e9, -1e9, 1e30, np.nan, np.inf, -np.inf, 5e-324)
_TEXTS = ("", "bus", "eci", GAP, "camera", "b\0s", "x" * 200, "\U0001f680")


class Trial:
    """What became of the inputs."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.failures: list[str] = []

    def take(self, kind: str, what: str, action: Callable[[], str]) -> None:
        """Does something that says `taken` or `refused`, or why it must not have ended so."""
        try:
            said = action()
        except Exception:
            said = traceback.format_exc()
        if said not in ("taken", "refused"):
            self.failures.append(f"{what[:2000]}: {said}")
            said = "failed"
        self.counts[f"{kind} {said}"] += 1


def _one_line(text: str) -> str:
    """`refused`, unless a refusal is none that a person can use."""
    return "refused" if text and "\n" not in text and len(text) < 2000 else f"refused by {text!r}"


# Messages


class _Listener:
    """A component behind its edges, as a host has it."""

    def __init__(self, component: type[Component], name: str, mission: Mission) -> None:
        node = mission.node(name)
        self.stepper = Stepper(component, name, node.canonical, mission.events, mission.epoch_ns)
        inputs = component.inputs(name, node.values)
        self.edges = {source.key: Edge(source, node.values, lambda _: None) for source in inputs}
        self.matcher = Matcher(self.stepper.component, inputs, self.edges.keys())
        self.withheld: list[str] = []
        self.stepper.withheld = lambda topic, field: self.withheld.append(f"{topic}: {field}")

    def hear(self, key: str, data: bytes) -> str:
        """Takes a message and steps if it makes a cycle."""
        sample = self.edges[key].accept(data)
        if sample is None:
            return "refused"
        for stamp_ns, received in self.matcher.offer(key, sample):
            list(self.stepper.sent(stamp_ns, self.stepper.step(stamp_ns, received)))
        return f"withheld {self.withheld}" if self.withheld else "taken"


def _message(source: Input, stamp_ns: int, draw: random.Random) -> bytes:
    """A message of an input, whole or damaged in some way."""
    codec = codec_of(source.message_type)
    lengths = {name: np.full(length, draw.choice((0.0, 0.3, 1.0))) for name, length in source.lengths.items()}
    frame = "eci" if source.frame == "inertial" else "bus"
    sample = codec.sample(stamp_ns, frame, **lengths)
    for _ in range(draw.choice((0, 0, 0, 1, 1, 2, 5))):
        _spoil(sample, codec.fields, draw)
    data = bytearray(codec.encode(sample))
    kind = draw.randrange(12)
    if kind == 0:
        data = data[: draw.randrange(len(data) + 1)]
    elif kind == 1:
        for _ in range(draw.randint(1, 8)):
            data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
    elif kind == 2:
        data += draw.randbytes(draw.randint(1, 64))
    return bytes(data)


def _spoil(sample: Sample, fields: list, draw: random.Random) -> None:
    if draw.random() < 0.2:
        sample.stamp_ns += draw.choice((0, 1, -1, 10**8, -(10**8), 10**11, -(10**17)))
        return
    if draw.random() < 0.1:
        sample.frame_id = draw.choice(_TEXTS)
        return
    field = draw.choice(fields)
    if field.code not in "df":
        return
    value = getattr(sample, field.name)
    if np.ndim(value) == 0:
        setattr(sample, field.name, draw.choice(_NUMBERS))
    elif field.count == 0 and draw.random() < 0.3:
        setattr(sample, field.name, np.array([draw.choice(_NUMBERS) for _ in range(draw.randint(0, 12))]))
    elif len(value):
        value = np.array(value)
        value[draw.randrange(len(value))] = draw.choice(_NUMBERS)
        setattr(sample, field.name, value)


def fuzz_messages(trial: Trial, count: int, draw: random.Random, missions: list[Mission]) -> None:
    """Messages to every component but the plant, which ends a flight whose spacecraft is torn apart."""
    listeners = [
        (mission, _Listener(node.component, node.name, mission))
        for mission in missions
        for node in mission.nodes
        # a slit sensor fails by intention at a truth that is not the motion which it reckons with
        if not issubclass(node.component, (Plant, SlitSensor)) and node.inputs
    ]
    for k in range(count):
        mission, listener = listeners[k % len(listeners)]
        key, edge = draw.choice(sorted(listener.edges.items()))
        stamp_ns = mission.epoch_ns + (k // len(listeners)) // 3 * mission.period_ns
        data = _message(edge.source, stamp_ns, draw)
        name = listener.stepper.component.name
        trial.take(
            "messages",
            f"{mission.name}: {name}.{key}: {data.hex()}",
            partial(listener.hear, key, data),
        )


# Parameters and requests


def _value(draw: random.Random) -> Any:
    return draw.choice(
        (
            True, 1, -(2**63), 0.5, np.nan, np.inf, 1e308, "", "x" * 3000, "\0", [], [1.0], [np.nan] * 3,
            ["cell.1 dead"], ["cell.99 dead", ""], ["message.x dropped 1"], [1, 2], [True], [1.0] * 5000,
        )
    )  # fmt: skip


def _set(node: ComponentNode, name: str, value: Any) -> str:
    before = dict(node.canonical)
    (result,) = node.set_parameters([RosParameter(name, value=value)])
    if result.successful:
        return "taken"
    if shown(node.canonical) != shown(before):
        return "a refusal changed something"
    return _one_line(result.reason)


def fuzz_parameters(trial: Trial, count: int, draw: random.Random, nodes: list[ComponentNode]) -> None:
    """Values of all kinds for parameters of living nodes."""
    for _ in range(count):
        node = draw.choice(nodes)
        tunable = [p.name for p in node.component_type.table() if p.tunable]
        name = draw.choice(tunable if draw.random() < 0.7 else [*node.canonical])
        near = other_value(node.canonical[name], draw) if draw.random() < 0.5 else _value(draw)
        trial.take("parameters", f"{node.get_name()}.{name}={near!r}", partial(_set, node, name, near))


def _target(node: ComponentNode, sort: str, draw: random.Random) -> str:
    host = node.mission.node(node.get_name()).host
    sort = sort if sort in host.units and draw.random() < 0.8 else draw.choice(sorted(host.units))
    units = [*host.units[sort], "all", "any", "0-1", "99", "", "-1"]
    right = f"{sort}.{draw.choice(units)}"
    return right if draw.random() < 0.85 else draw.choice((sort, "", "x y", draw.choice(_TEXTS)))


def _kind(node: ComponentNode, draw: random.Random) -> FaultKind:
    return draw.choice(node.mission.node(node.get_name()).host.kinds)


def fuzz_requests(trial: Trial, count: int, draw: random.Random, nodes: list[ComponentNode]) -> None:
    """Requests of operators to begin and end faults."""
    for _ in range(count):
        node = draw.choice(nodes)
        services = node.fault_services
        if draw.random() < 0.2:
            asked = ClearFault.Request(fault=draw.choice(("", "cell.1", "all", draw.choice(_TEXTS))))
            call, response = services._clear, ClearFault.Response()
        else:
            kind = _kind(node, draw)
            given = draw.choice((len(kind.values),) * 5 + (0, 1, 5))
            values = [draw.choice(_NUMBERS) if draw.random() < 0.2 else 1.0 for _ in range(given)]
            asked = InjectFault.Request(
                target=_target(node, kind.sort, draw),
                kind=kind.name if draw.random() < 0.85 else draw.choice((*_TEXTS, "x y")),
                values=values,
                duration=float(draw.choice((0.0, 0.0, 0.0, 1.0, 1.0, -1.0, np.nan, np.inf, 1e300))),
            )
            call, response = services._inject, InjectFault.Response()
        trial.take("requests", f"{node.get_name()}: {asked}", partial(_asked, call, asked, response))


def _asked(call: Callable[[Any, Any], Any], request: Any, response: Any) -> str:
    response = call(request, response)
    return "taken" if response.success and not response.message else _one_line(response.message)


# Missions with faults


def _entries(mission: Mission, draw: random.Random) -> Iterator[str]:
    """A section `faults` of entries that are right, nearly right or not at all."""
    yield "    faults:"
    for k in range(draw.randint(1, 4)):
        node = draw.choice(mission.nodes)
        kind = draw.choice(node.host.kinds)
        if kind.sort not in node.host.units and draw.random() < 0.8:
            kind = draw.choice([k for k in node.host.kinds if k.sort in node.host.units])
        units = [*node.host.units.get(kind.sort, ("0",)), draw.choice(("all", "any", "0"))]
        given = {"time": draw.choice(("0.0", "0.5", "1.5")), "target": f"{kind.sort}.{draw.choice(units)}"}
        given |= {"kind": kind.name} | {v.parameter.name: draw.choice(("1.0",) * 9 + ("0.3",)) for v in kind.values}
        if draw.random() < 0.3:
            given |= {"end": "1.0", "probability": "0.5", "within": "0.5"}
        for _ in range(draw.choice((0, 0, 0, 0, 1, 2))):
            key = draw.choice([*given, "x", "other"])
            if draw.random() < 0.3:
                given.pop(key, None)
            else:
                given[key] = draw.choice([word for word in WORDS if "\n" not in word])
        yield f"      e{k}: {{{', '.join(f'{key}: {value}' for key, value in given.items())}}}"


def fuzz_faults(trial: Trial, count: int, draw: random.Random, missions: list[Mission]) -> None:
    """Missions with sections `faults`; of those that are taken some are flown for a moment."""
    for k in range(count):
        base = draw.choice(missions)
        section = "\n".join(_entries(base, draw))
        text = f"/**:\n  ros__parameters:\n    extends: {base.name}\n{section}\n"
        trial.take("faults", text, partial(_fly_shortly, text, k % 20 == 0))


def _fly_shortly(text: str, flies: bool) -> str:
    try:
        mission = mission_from_text(text, "fuzz.yaml")
        if flies:
            period = mission.values.mission.period
            bad = first_not_finite(mission.with_overrides([f"mission.duration={STEPS * period!r}"]))
            return bad or "taken"
    except MissionError as error:
        return _one_line(str(error))
    return "taken"


def run(count: int, seed: int) -> Trial:
    """A quarter of so many inputs of each kind; the same seed gives the same ones."""
    draw = random.Random(seed)
    trial = Trial()
    missions = [load_mission(path) for path in sorted(CONFIG.glob("*.yaml"))]
    orbiting = [m for m in missions if m.name in ("okeefe_2013", "cubesat_vmm", "esprit_2006")]
    fuzz_messages(trial, count // 4, draw, missions)
    fuzz_faults(trial, count // 4, draw, orbiting)
    with Bench() as bench:
        mission = load_mission("cubesat_vmm")
        nodes = [bench.host(node.component, mission, node.name) for node in mission.nodes if node is not mission.plant]
        fuzz_requests(trial, count // 4, draw, nodes)
        fuzz_parameters(trial, count // 4, draw, nodes)
    return trial


def main() -> int:
    """Entry point; 1 when something failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    with own_domain("cubesat_vmm", None, None, console):
        trial = run(arguments.count, arguments.seed)
    for failure in trial.failures[:50]:
        print(failure)
    print(json.dumps(dict(sorted(trial.counts.items()))))
    return int(bool(trial.failures))


if __name__ == "__main__":
    sys.exit(main())
