# SPDX-License-Identifier: Apache-2.0
"""A flight in processes says what its nodes compile, from their logs, and no more than now and then."""

from types import SimpleNamespace

from css_bringup.compiling_processes import CompilingProcesses
from css_common.compile_news import BEGINS
from css_common.progress_lines import EVERY


def test_the_log_of_a_node_that_compiles_is_told_and_not_twice(tmp_path, capsys):
    wall = SimpleNamespace(now=0.0)
    logs = {name: tmp_path / f"{name}.log" for name in ("gyro", "ekf", "dynamics", "late")}
    logs["gyro"].write_text("gyro: active\n")
    logs["ekf"].write_text(f"started\n{BEGINS}: 4 in 2 s so far\n")
    logs["dynamics"].write_text(f"{BEGINS}: 7 in 3 s so far\ndynamics: active\n")
    processes = CompilingProcesses(lambda: wall.now)

    def told(after):
        wall.now += after
        processes.tell(logs)
        return capsys.readouterr().err

    assert told(0.9 * EVERY) == ""
    assert told(0.2 * EVERY) == f"ekf: {BEGINS}: 4 in 2 s so far\n"
    assert told(0.5 * EVERY) == "", "not due"
    assert told(EVERY) == "", "it was said"
    with logs["ekf"].open("a") as log:
        log.write(f"{BEGINS}: 9 in 12 s so far\n")
    assert told(EVERY) == f"ekf: {BEGINS}: 9 in 12 s so far\n"
