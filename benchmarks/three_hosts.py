# SPDX-License-Identifier: Apache-2.0
"""A mission flown by three hosts, simulation, estimation and control, whose link is cut for a while and comes back.

Simulated time goes with the wall clock, a factor faster. What a flight takes longer than that, and longer than one
whose link is not cut, is lost: it may be no more than the time of the cut and what a writer needs to be heard again.
Every flight must end power positive, with every message of every cycle. The last line is a JSON array.
"""

import argparse
import json
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import hosts

from css_analysis.estimator_runs import estimator_runs
from css_analysis.flight_log import read_flight
from css_bringup.child import Child
from css_bringup.flight_result import as_flown
from css_bringup.incidents import lost_messages
from css_bringup.processes import RECORDER, executable_path
from css_common.mission import Mission, load_mission

PLACES = {"dynamics": "sim", "css_array": "sim", "gyro": "sim", "ekf": "estimation", "mrp_control": "control"}
HOSTS = ("sim", "estimation", "control")
IN_FLIGHT = 150_000  # bytes of a recording whose flight goes on; with its mission it begins with a few ten thousand
PERIOD_S = 0.1  # [s] within which a writer asks again who has not heard it: reliability costs no more than that
_HEARD_S = 3.0 * PERIOD_S

_PROFILE = """<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"><profiles>
  <data_writer profile_name="heard" is_default_profile="true">
    <times><heartbeatPeriod><sec>0</sec><nanosec>{nanoseconds}</nanosec></heartbeatPeriod></times>
  </data_writer>
</profiles></dds>
"""


class Flight:
    """The processes of a flight on their hosts, the recorder with the simulation."""

    def __init__(self, mission: Mission, folder: Path, network: hosts.Network) -> None:
        """Starts them, the plant last."""
        self.mission, self.bag = mission, folder / "bag"
        self._folder = folder
        parameters, text, profile = folder / "flown.yaml", folder / "mission.yaml", folder / "profile.xml"
        parameters.write_text(as_flown(mission, recorded=True).text(), encoding="utf-8")
        text.write_text(mission.text(), encoding="utf-8")
        profile.write_text(_PROFILE.format(nanoseconds=round(PERIOD_S * 1e9)), encoding="utf-8")
        os.environ |= {
            "FASTRTPS_DEFAULT_PROFILES_FILE": str(profile),
            "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",  # shared memory would reach through the walls
            "SUNPOINT_NETWORK": "subnet",
        }
        assert mission.plant is not None
        recorder = [executable_path("css_recording", RECORDER), "--mission", str(text), "--in-flight"]
        recorder += ["--output", str(self.bag), "--summary", str(self.summary(RECORDER))]
        self.children = [Child(RECORDER, network.on("sim", recorder), folder / f"{RECORDER}.log")]
        for node in sorted(mission.nodes, key=lambda node: node is mission.plant):
            command = [executable_path(node.package, node.executable), "--summary", str(self.summary(node.name))]
            command += ["--ros-args", "--params-file", str(parameters), "-r", f"__node:={node.name}"]
            log = folder / f"{node.name}.log"
            self.children.append(Child(node.name, network.on(PLACES[node.name], command), log))
        for child in self.children:
            child.start()

    @property
    def plant(self) -> Child:
        """The process that owns simulated time."""
        return self.children[-1]

    @property
    def recorded_bytes(self) -> int:
        """Size of the recording."""
        return sum(file.stat().st_size for file in self.bag.glob("*.mcap"))

    def summary(self, name: str) -> Path:
        """Where a process leaves its figures."""
        return self._folder / f"{name}.json"

    def has_died(self) -> str:
        """The name of a process that is gone, other than by the end of the flight; empty: none."""
        return next((c.name for c in self.children if c.poll() is not None and (c is not self.plant or c.poll())), "")

    def end(self) -> None:
        """Ends all processes, the recorder last."""
        for child in reversed(self.children):
            child.stop(30.0)


def fly(mission: Mission, folder: Path, network: hosts.Network, cut: str, cut_s: float) -> dict[str, Any]:
    """Flies a mission whose host `cut` is cut off for so long [s of the wall clock] in its middle; what came of it.

    Nothing is cut where `cut` is `nothing`.
    """
    flight = Flight(mission, folder, network)
    limit = time.monotonic() + 60.0 + 5.0 * (mission.values.mission.duration + cut_s)
    cut_at = mended_at = 0.0
    died = ""
    try:
        while flight.plant.poll() is None and not died and time.monotonic() < limit:
            died = flight.has_died()
            if cut in HOSTS and not cut_at and flight.recorded_bytes > IN_FLIGHT:
                network.cut(cut)
                cut_at = time.monotonic()
            elif cut_at and not mended_at and time.monotonic() - cut_at >= cut_s:
                network.mend(cut)
                mended_at = time.monotonic()
            time.sleep(0.02)
    finally:
        flight.end()
    outcome: dict[str, Any] = {"cut": cut, "cut_s": mended_at - cut_at if mended_at else 0.0, "died": died}
    plant, recorder = (flight.summary(name) for name in (flight.plant.name, RECORDER))
    if not (plant.exists() and recorder.exists()):
        logs = "\n".join(f"{child.name}: {child.log_tail(5)}" for child in flight.children)
        return outcome | {"failure": f"{died or 'a process'} left no figures; logs end:\n{logs}"}
    flown = json.loads(plant.read_text(encoding="utf-8"))
    recorded = json.loads(recorder.read_text(encoding="utf-8"))["recorded"]
    steps = flown["counters"].get("cycles", 0)
    paced_s = steps * mission.values.mission.period / mission.values.lockstep.realtime_factor
    log = read_flight(flight.bag)
    (run,) = estimator_runs(log)
    return outcome | {
        "steps": steps,
        "expected_steps": mission.steps,
        "lost_s": flown["wall_s"] - paced_s,
        "partners_lost": flown["counters"].get("partners_lost", 0),
        "lost_messages": lost_messages(mission, steps, recorded),
        "power_positive_s": run["power_positive_s"],
        "failure": "",
    }


def judged(outcome: dict[str, Any], usual_s: float) -> list[str]:
    """What of a flight must not be; `usual_s`: what a flight without a cut loses, to a machine that is busy."""
    if outcome["failure"]:
        return [outcome["failure"]]
    wrong = []
    if outcome["cut"] in HOSTS and not outcome["cut_s"]:
        wrong.append("the link was not cut and mended in time")
    if outcome["steps"] != outcome["expected_steps"]:
        wrong.append(f"{outcome['steps']} of {outcome['expected_steps']} steps flown")
    if outcome["lost_messages"]:
        wrong.append(f"messages lost: {outcome['lost_messages']}")
    longer_s = outcome["lost_s"] - usual_s
    if longer_s > outcome["cut_s"] + _HEARD_S:
        wrong.append(f"{longer_s:.2f} s lost in a cut of {outcome['cut_s']:.2f} s")
    if outcome["partners_lost"]:
        wrong.append("the flight went on without a partner")
    if outcome["power_positive_s"] is None:
        wrong.append("it did not end power positive")
    return wrong


def main() -> int:
    """Entry point; 1 when something happened that must not, 2 where there can be no such network."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--duration", type=float, default=300.0, help="simulated time [s]")
    parser.add_argument("--factor", type=float, default=5.0, help="simulated time over wall time")
    parser.add_argument("--cut", nargs="+", choices=HOSTS, default=list(HOSTS), help="hosts to cut off, one a flight")
    parser.add_argument("--cut-s", type=float, default=10.0, help="for how long [s of the wall clock]")
    arguments = parser.parse_args()
    reason = hosts.refusal()
    if reason:
        print(reason, file=sys.stderr)
        return 2
    hosts.enter()
    shared = [f"mission.duration={arguments.duration}", f"lockstep.realtime_factor={arguments.factor}"]
    mission = load_mission("okeefe_2013", shared)
    network = hosts.Network(HOSTS)
    outcomes: list[dict[str, Any]] = []
    wrong: list[str] = []
    for cut in ("nothing", *arguments.cut):
        with tempfile.TemporaryDirectory(prefix="sunpoint_hosts_") as folder:
            outcomes.append(fly(mission, Path(folder), network, cut, arguments.cut_s))
        found = judged(outcomes[-1], outcomes[0].get("lost_s", 0.0))
        wrong += found
        print(outcomes[-1], *found, sep="; ", flush=True)
    print(json.dumps(outcomes))
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
