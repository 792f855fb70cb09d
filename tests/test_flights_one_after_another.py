# SPDX-License-Identifier: Apache-2.0
"""`fly --stay`: flights in one process and one domain, each asked for by a service, driven from outside."""

import signal
import subprocess

from diagnostic_msgs.msg import DiagnosticArray
from std_srvs.srv import Trigger

from css_bringup.processes import executable_path
from css_common.testing import Bench
from css_msgs.msg import SpacecraftState
from css_msgs.srv import ResetFlight

T0 = 1_370_044_800_000_000_000
FLY = ("okeefe_2013", "--stay", "--paused", "--no-record", "--duration", "4")


def test_each_begins_when_it_is_asked_for():
    command = [executable_path("css_bringup", "fly"), *FLY]
    with (
        Bench() as bench,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as fly,
    ):
        truth = bench.listen("truth", SpacecraftState)
        said: dict[str, str] = {}

        def note(array):
            said.update({status.name: status.message for status in array.status})

        bench.node.create_subscription(DiagnosticArray, "/diagnostics", note, 100)

        def ask(kind, name, **fields):
            return bench.request(kind, name, kind.Request(**fields))

        def until_ended(words):
            bench.until(lambda: said.get("/flight") == words, words)

        try:
            bench.until(lambda: said.get("/dynamics") == "paused", "it holds at the epoch")
            assert {sample.stamp_ns for sample in truth} <= {T0}
            assert ask(Trigger, "/dynamics/resume").success
            until_ended("ended: okeefe_2013, case 0")
            assert truth[-1].stamp_ns == T0 + 3_900_000_000
            first = truth[0].sigma_bn.tolist()

            refused = ask(ResetFlight, "/flight/reset", case_number=-1, overrides=["ekf.gate=9"], keep=True)
            assert not refused.success and "gate" in refused.message
            assert said["/flight"].startswith("ended: ")

            truth.clear()
            assert ask(ResetFlight, "/flight/reset", case_number=5, estimator="wavg", keep=True).success
            until_ended("ended: okeefe_2013, case 5")
            assert truth[0].stamp_ns == T0 and truth[-1].stamp_ns == T0 + 3_900_000_000
            assert truth[0].sigma_bn.tolist() != first

            # in the middle of a flight, whose time is far from over
            long = ["mission.duration=100000"]
            assert ask(ResetFlight, "/flight/reset", case_number=6, overrides=long).success
            bench.until(lambda: truth[-1].stamp_ns > T0 + 10_000_000_000, "it flies")
            truth.clear()
            assert ask(ResetFlight, "/flight/reset", case_number=0, overrides=["mission.duration=4"]).success
            until_ended("ended: okeefe_2013, case 0")
            at_epoch = [sample for sample in truth if sample.stamp_ns == T0]
            assert [sample.sigma_bn.tolist() for sample in at_epoch] == [first]
        finally:
            fly.send_signal(signal.SIGINT)
            output, _ = fly.communicate(timeout=60.0)
    assert fly.returncode == 0, output
    assert "flies again: okeefe_2013, case 5" in output
    assert "Traceback" not in output
