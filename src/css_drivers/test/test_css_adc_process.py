# SPDX-License-Identifier: Apache-2.0
"""The driver as the process that `ros2 run` starts: it reads, and it ends at once and cleanly."""

import os
import pty
import signal
import subprocess
import threading
import tty
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_prefix

from css_common.testing import Bench
from css_drivers.text_line import LineFormat, usual_fields, write_line
from css_msgs.msg import CssVoltages

FORM = LineFormat("$CSS", ",", "xor", usual_fields(2), 2)


@pytest.fixture
def file(tmp_path):
    """A parameter file with the port of a pseudo-terminal, and the other end of that."""
    end, other = pty.openpty()
    tty.setraw(other)
    path = tmp_path / "mine.yaml"
    path.write_text(
        "camera: {ros__parameters: {fps: 30}}\n"
        "/**/css_adc:\n  ros__parameters:\n    cells: {normals: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]}\n"
        f"    converter: line\n    line: {{port: {os.ttyname(other)}}}\n",
        encoding="utf-8",
    )
    yield path, end
    os.close(end)
    os.close(other)


def start(*arguments):
    program = Path(get_package_prefix("css_drivers")) / "lib" / "css_drivers" / "css_adc"
    return subprocess.Popen([program, *arguments], stderr=subprocess.PIPE, text=True)


@pytest.mark.parametrize("stopped_by", [signal.SIGINT, signal.SIGTERM])
def test_it_publishes_until_it_is_told_to_stop(file, stopped_by):
    path, end = file
    with Bench("events") as bench:
        heard = bench.listen("css/voltages", CssVoltages)
        process = start("--ros-args", "--params-file", str(path))
        over = threading.Event()

        def print_lines():
            sequence = 0
            while not over.wait(0.02):
                sequence += 1
                os.write(end, write_line(FORM, sequence, [0.25, 0.75]))

        board = threading.Thread(target=print_lines)
        board.start()
        try:
            bench.until(lambda: len([m for m in heard if m.frame_id == "bus"]) > 5, "readings")
        finally:
            over.set()
            board.join()
            process.send_signal(stopped_by)
            _, said = process.communicate(timeout=60)
        assert process.returncode == 0, said
        assert "Traceback" not in said
        assert [m for m in heard if m.frame_id == "bus"][-1].voltages.tolist() == [0.25, 0.75]


def test_wrong_parameters_are_one_line_and_exit_code_2(file):
    path, _ = file
    process = start("--ros-args", "--params-file", str(path), "-p", "full_scale:=[0.0]")
    _, said = process.communicate(timeout=100)
    assert process.returncode == 2
    (line,) = [line for line in said.splitlines() if "error" in line]
    assert "full_scale" in line
    assert "above 0" in line
