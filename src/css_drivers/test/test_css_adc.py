# SPDX-License-Identifier: Apache-2.0
"""The driver of cells in its node: calibrated voltages out, gaps while there are none, and back by itself."""

import glob
import os
import pty
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest
from chip_models import Adc128d818Model, Ads1115Model, FakeSMBus, Mcp3208Model
from diagnostic_msgs.msg import DiagnosticStatus

from css_common.link import GAP
from css_common.mission import find_component
from css_common.mission_file import MissionError
from css_drivers.text_line import LineFormat, usual_fields, write_line
from css_msgs.msg import CssVoltages

CALIBRATED = "full_scale: [2.0, 2.0, 1.0], dark_level: [0.1, 0.0, -0.05], retry: 0.05"
VOLTS = [2.1, 0.5, 0.2, 3.0]
EXPECTED = [1.0, 0.25, 0.25]
LINE = LineFormat("$CSS", ",", "xor", usual_fields(3), 3)


class Adc:
    """A driver in its node, and what it publishes."""

    def __init__(self, bench, mission, parameters):
        self.bench = bench
        self.heard = bench.listen("css/voltages", CssVoltages)
        self.node = bench.host(find_component("css_drivers", "css_adc"), mission("css_adc", parameters), "css_adc")

    @property
    def figures(self):
        return self.node.health().counters

    def until(self, condition, what):
        self.bench.until(condition, what)

    def until_message(self, wanted, what):
        """Waits for a message from now on that is as wanted."""
        begin = len(self.heard)
        self.until(lambda: any(wanted(m) for m in self.heard[begin:]), what)
        return next(m for m in self.heard[begin:] if wanted(m))


def is_reading(message):
    return message.frame_id == "bus"


def is_gap(message):
    return message.frame_id == GAP


@pytest.fixture
def chip_bus(monkeypatch):
    """The bus that every driver opens."""
    bus = FakeSMBus({0x48: Ads1115Model(VOLTS)})

    def opened(number):
        if bus.gone:
            raise FileNotFoundError(2, "No such file or directory")
        bus.opened.append(number)
        return bus

    monkeypatch.setattr("smbus2.SMBus", opened)
    return bus


def test_voltages_are_calibrated_and_stamped_on_the_wall_clock(bench, mission, chip_bus):
    before = time.time_ns()
    adc = Adc(bench, mission, f"{CALIBRATED}, i2c: {{bus: 7}}")
    messages = [adc.until_message(is_reading, "a reading") for _ in range(3)]
    for message in messages:
        np.testing.assert_allclose(message.voltages, EXPECTED, atol=1e-4)
        assert message.saturated == 0
        assert before < message.stamp_ns < time.time_ns()
    stamps = [m.stamp_ns for m in adc.heard]
    assert stamps == sorted(set(stamps))
    assert chip_bus.opened == [7]
    adc.until(lambda: adc.figures["reads"] >= 5 and "latency_ms_p99" in adc.figures, "latencies")
    assert 0.0 < adc.figures["latency_ms_p50"] <= adc.figures["latency_ms_p99"] <= adc.figures["latency_ms_max"]
    assert adc.figures["scan_ms_p50"] > 3 * 1e3 / 860  # three conversions
    assert adc.node.health().level == DiagnosticStatus.OK


def test_cell_at_the_converters_limit_is_said(bench, mission, chip_bus):
    chip_bus.chips[0x48].volts[1] = 5.0
    adc = Adc(bench, mission, CALIBRATED)
    assert adc.until_message(is_reading, "a reading").saturated == 0b010


def test_bus_that_vanishes_gives_gaps_and_comes_back_by_itself(bench, mission, chip_bus):
    adc = Adc(bench, mission, CALIBRATED)
    adc.until_message(is_reading, "a reading")
    chip_bus.gone = True
    gap = adc.until_message(is_gap, "a gap")
    assert gap.voltages.tolist() == [0.0, 0.0, 0.0]
    adc.until(lambda: adc.figures["errors_gone"] >= 2, "it is tried again")
    health = adc.node.health()
    assert health.level == DiagnosticStatus.ERROR
    assert "no reading for" in health.message
    assert chip_bus.closed
    chip_bus.gone = False
    adc.until_message(is_reading, "a reading again")
    assert adc.node.health().level == DiagnosticStatus.OK
    assert adc.figures["recoveries"] == 1
    assert bench.logged("reads again after")


@pytest.mark.parametrize("trouble", ["refused", "timeout", "trash"])
def test_chip_in_trouble_costs_its_scans_alone(bench, mission, chip_bus, trouble):
    model = chip_bus.chips[0x48]
    adc = Adc(bench, mission, CALIBRATED)
    adc.until_message(is_reading, "a reading")
    if trouble == "refused":
        del chip_bus.chips[0x48]
    model.stuck, model.loses_supply = trouble == "timeout", trouble == "trash"
    adc.until_message(is_gap, "a gap")
    adc.until(lambda: adc.figures[f"errors_{trouble}"] >= 4, "it is said what it is")
    chip_bus.chips[0x48] = model
    model.stuck = model.loses_supply = False
    adc.until_message(is_reading, "a reading again")
    assert adc.figures["errors_gone"] == 0


def test_converter_whose_output_never_moves_is_said(bench, mission, chip_bus):
    adc = Adc(bench, mission, f"{CALIBRATED}, stuck_scans: 5")
    adc.until(lambda: "stuck" in adc.node.health().message, "it is said")
    assert adc.node.health().level == DiagnosticStatus.WARN
    chip_bus.chips[0x48].volts[1] = 0.6
    adc.until(lambda: "stuck" not in adc.node.health().message, "it moves")


def test_eight_cells_on_two_chips_in_any_order(bench, mission, chip_bus):
    chip_bus.chips[0x49] = Ads1115Model([0.1, 0.2, 0.3, 0.4])
    adc = Adc(bench, mission, "inputs: [6, 0, 4], i2c: {addresses: [72, 73]}")
    np.testing.assert_allclose(adc.until_message(is_reading, "a reading").voltages, [0.3, 2.1, 0.1], atol=1e-4)


def test_adc128d818_in_its_node(bench, mission, chip_bus):
    chip_bus.chips = {0x1D: Adc128d818Model([2.1, 0.5, 0.2, 0, 0, 0, 0, 0])}
    adc = Adc(bench, mission, f"{CALIBRATED}, converter: adc128d818, i2c: {{addresses: [29]}}, scan_period: 0.05")
    np.testing.assert_allclose(adc.until_message(is_reading, "a reading").voltages, EXPECTED, atol=7e-4)


def test_mcp3208_in_its_node(bench, mission, monkeypatch):
    model = Mcp3208Model([2.1, 0.5, 0.2, 0, 0, 0, 0, 0])
    monkeypatch.setitem(sys.modules, "spidev", SimpleNamespace(SpiDev=lambda: model))
    adc = Adc(bench, mission, f"{CALIBRATED}, converter: mcp3208")
    np.testing.assert_allclose(adc.until_message(is_reading, "a reading").voltages, EXPECTED, atol=1e-3)
    assert (model.mode, model.max_speed_hz) == (0, 1_000_000)
    model.gone = True
    adc.until_message(is_gap, "a gap")
    model.gone = False
    adc.until_message(is_reading, "a reading again")


def test_without_spidev_it_is_said_what_brings_it(bench, mission, monkeypatch):
    monkeypatch.setitem(sys.modules, "spidev", None)
    adc = Adc(bench, mission, f"{CALIBRATED}, converter: mcp3208")
    adc.until_message(is_gap, "a gap")
    assert "pip install spidev" in adc.node.health().message


class Line:
    """A pseudo-terminal: what a microcontroller would be, and the port that the driver opens."""

    def __init__(self):
        self.end, other = pty.openpty()
        self.port = os.ttyname(other)
        os.close(other)
        self.sequence = 0

    def say(self, values, skip=0):
        self.sequence += 1 + skip
        os.write(self.end, write_line(LINE, self.sequence, values))

    def close(self):
        if self.end >= 0:
            os.close(self.end)
        self.end = -1


@pytest.fixture
def line():
    line = Line()
    yield line
    line.close()


def test_serial_line_with_trouble_on_it(bench, mission, line):
    parameters = f"{CALIBRATED}, converter: line, line: {{port: {line.port}, patience: 0.3}}"
    adc = Adc(bench, mission, parameters)
    adc.until(lambda: adc.figures["errors_timeout"] >= 1, "silence is said")

    def hears(values, expected):
        line.say(values)
        message = adc.until_message(is_reading, "the line")
        np.testing.assert_allclose(message.voltages, expected, atol=1e-6)

    hears([2.1, 0.5, 0.2], EXPECTED)
    os.write(line.end, b"\x00\xff trash\n" + write_line(LINE, 9, [1.0, 1.0, 1.0])[:-4] + b"00\r\n")
    hears([0.1, np.nan, -0.05], [0.0, np.nan, 0.0])
    assert adc.figures["lines_bad_prefix"] + adc.figures["lines_bad_checksum"] == 2
    line.say([0.0, 0.0, 0.0], skip=3)
    adc.until(lambda: adc.figures.get("lines_lost") == 3, "lost lines are counted")
    line.say([np.nan] * 3)
    adc.until_message(is_gap, "a line without any output is a gap")
    assert adc.node.health().level == DiagnosticStatus.WARN


def test_line_that_is_pulled_out_comes_back_elsewhere(bench, mission, line, tmp_path):
    link = tmp_path / "port"
    link.symlink_to(line.port)
    adc = Adc(bench, mission, f"{CALIBRATED}, converter: line, line: {{port: {link}, patience: 0.2}}")
    adc.until(lambda: adc.figures["errors_timeout"] >= 1, "the port is open")
    line.say([2.1, 0.5, 0.2])
    adc.until_message(is_reading, "a reading")
    line.close()
    link.unlink()
    adc.until(lambda: adc.figures["errors_gone"] >= 1, "it is gone")
    again = Line()
    link.symlink_to(again.port)
    begin, timeouts = len(adc.heard), adc.figures["errors_timeout"]
    adc.until(lambda: adc.figures["errors_timeout"] > timeouts, "the port is open again")
    again.say([2.1, 0.5, 0.2])
    adc.until(lambda: any(map(is_reading, adc.heard[begin:])), "a reading again")
    again.close()


def test_node_that_is_deactivated_lets_the_bus_go_and_takes_it_again(bench, mission, chip_bus):
    adc = Adc(bench, mission, CALIBRATED)
    adc.until_message(is_reading, "a reading")
    adc.node.trigger_deactivate()
    assert chip_bus.closed
    adc.node.trigger_activate()
    adc.until_message(is_reading, "a reading again")
    assert adc.node.counters["device_hangs"] == 0


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        ("inputs: [0, 1]", "a different one for each of the 3 cells"),
        ("inputs: [0, 1, 1]", "a different one for each of the 3 cells"),
        ("inputs: [0, 1, 8]", "expected at most 7"),
        ("i2c: {addresses: [40]}", "0x48"),
        ("full_scale: [1.0, 2.0]", "one for each of the 3 cells"),
        ("ads1115: {range: 5.0}", "6.144"),
        ("ads1115: {rate: 100}", "128"),
        ("ads1115: {rate: 8}", "take 0.375 s"),
        ("converter: line, line: {fields: [cell.0]}", "each of the 3 cells once"),
        ("converter: adc128d818, i2c: {addresses: [29]}", "take 0.0366 s"),
    ],
)
def test_what_cannot_be_is_refused_before_it_is_tried(mission, parameters, reason):
    with pytest.raises(MissionError, match=reason.replace("[", r"\[")):
        mission("css_adc", parameters)


def _stub_bus():
    """Number of a bus of the kernel's i2c-stub with a chip at 0x48, if there is one."""
    for name in glob.glob("/sys/bus/i2c/devices/i2c-*/name"):
        with open(name) as file:
            if "SMBus stub driver" in file.read() and os.access(f"/dev/i2c-{name.split('i2c-')[1].split('/')[0]}", 6):
                return int(name.split("i2c-")[1].split("/")[0])
    return None


def test_on_the_kernels_stub_bus(bench, mission):
    bus = _stub_bus()
    if bus is None:
        pytest.skip("no i2c-stub: modprobe i2c-dev; modprobe i2c-stub chip_addr=0x48, and access to its /dev/i2c-N")
    from smbus2 import SMBus

    with SMBus(bus) as raw:
        raw.write_word_data(0x48, 0, 0x0040)  # 0x4000, half of full scale; the stub keeps registers as they are
    adc = Adc(bench, mission, f"i2c: {{bus: {bus}}}, full_scale: [2.048]")
    np.testing.assert_allclose(adc.until_message(is_reading, "a reading").voltages, [1.0, 1.0, 1.0])
