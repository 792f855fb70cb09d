# SPDX-License-Identifier: Apache-2.0
"""Chips: what goes over the bus against their data sheets, what comes back, and every way to get none."""

import pytest
from chip_models import Adc128d818Model, Ads1115Model, FakeSMBus, Mcp3208Model
from hypothesis import given, settings
from hypothesis import strategies as st

from css_drivers import adc128d818, ads1115, mcp3208
from css_drivers.adc128d818 import Adc128d818
from css_drivers.ads1115 import Ads1115, config_word
from css_drivers.device_errors import GONE, REFUSED, TIMEOUT, TRASH, DeviceError
from css_drivers.mcp3208 import Mcp3208

ADDRESS = 0x48


@pytest.mark.parametrize(
    ("channel", "full_scale", "rate", "word"),
    [(0, 4.096, 128, 0xC383), (0, 2.048, 128, 0xC583), (1, 6.144, 860, 0xD1E3), (3, 0.256, 8, 0xFB03)],
)
def test_config_register_of_the_ads1115(channel, full_scale, rate, word):
    assert config_word(channel, full_scale, rate) == word


@given(
    st.lists(st.floats(-0.3, 6.1), min_size=4, max_size=4),
    st.sampled_from(ads1115.RANGES),
    st.permutations(range(4)),
)
def test_ads1115_reads_what_is_at_its_inputs(volts, full_scale, inputs):
    chip = Ads1115(FakeSMBus({ADDRESS: Ads1115Model(volts)}), ADDRESS, full_scale, 860)
    chip.begin()
    lsb = full_scale / 32768
    for channel, read in zip(inputs, chip.scan(inputs), strict=True):
        seen = min(volts[channel], full_scale - lsb)
        assert read.volts == pytest.approx(max(seen, -full_scale), abs=0.5 * lsb + 1e-12)
        assert read.at_limit == (volts[channel] >= full_scale - 1.5 * lsb)


@settings(max_examples=20)  # a round takes its 50 ms
@given(st.lists(st.floats(-0.3, 5.5), min_size=8, max_size=8), st.sampled_from([0.0, 3.3, 5.0]))
def test_adc128d818_reads_what_is_at_its_inputs(volts, reference):
    inputs = [5, 0, 7, 2]
    model = Adc128d818Model(volts, reference)
    chip = Adc128d818(FakeSMBus({0x1D: model}), 0x1D, reference, inputs)
    chip.begin()
    lsb = (reference or 2.56) / 4096
    assert model.registers[0x08] == 0b0101_1010  # the others are left out of the round
    for channel, read in zip(inputs, chip.scan(inputs), strict=True):
        assert -1e-12 < max(0.0, min(volts[channel], 4095 * lsb)) - read.volts < lsb + 1e-12
        assert read.at_limit == (volts[channel] >= 4095 * lsb)


@given(st.lists(st.floats(0.0, 4.0), min_size=8, max_size=8), st.sampled_from([2.5, 3.3, 5.0]))
def test_mcp3208_reads_what_is_at_its_inputs(volts, reference):
    chip = Mcp3208(Mcp3208Model(volts, reference), reference, "/dev/spidev0.0")
    lsb = reference / 4096
    for channel, read in enumerate(chip.scan(range(8))):
        assert -1e-12 < min(volts[channel], 4095 * lsb) - read.volts < lsb + 1e-12
        assert read.at_limit == (volts[channel] >= 4095 * lsb)


def test_request_of_the_mcp3208_is_that_of_its_data_sheet():
    # DS21298, figure 6-1: 0000 01 SGL D2 | D1 D0 xxxxxx | xxxxxxxx
    assert [mcp3208.request(c) for c in (0, 3, 4, 7)] == [[6, 0, 0], [6, 0xC0, 0], [7, 0, 0], [7, 0xC0, 0]]


def ads(model, bus=None):
    return Ads1115(bus or FakeSMBus({ADDRESS: model}), ADDRESS, 4.096, 860)


def adc(model):
    return Adc128d818(FakeSMBus({0x1D: model}), 0x1D, 0.0, range(8))


def kind_of(work):
    with pytest.raises(DeviceError) as caught:
        work()
    return caught.value.kind


def test_converter_that_does_not_come_to_an_end_is_a_timeout():
    stuck = Ads1115Model()
    stuck.stuck = True
    assert kind_of(lambda: ads(stuck).scan([0])) == TIMEOUT
    busy = Adc128d818Model()
    chip = adc(busy)
    chip.begin()
    busy.stuck = True
    assert kind_of(lambda: chip.scan([0])) == TIMEOUT
    never = Adc128d818Model()
    never.not_ready_reads = 10**9
    assert kind_of(adc(never).begin) == TIMEOUT


def test_converter_that_lost_its_supply_in_between_gives_no_reading():
    model = Ads1115Model([1.0] * 4)
    model.loses_supply = True
    assert kind_of(lambda: ads(model).scan([0])) == TRASH
    other = Adc128d818Model([1.0] * 8)
    chip = adc(other)
    chip.begin()
    chip.scan([0])
    other.registers[0x08] = 0xFF
    assert kind_of(lambda: chip.scan([0])) == TRASH


def test_nobody_at_the_address_and_no_bus_are_told_apart():
    bus = FakeSMBus({})
    assert kind_of(lambda: ads(None, bus).begin()) == REFUSED
    bus.gone = True
    assert kind_of(lambda: ads(None, bus).begin()) == GONE


def test_another_chip_at_the_address_is_none():
    model = Adc128d818Model()
    model.identity = (0x41, 0x20)
    assert kind_of(adc(model).begin) == TRASH


def test_line_that_no_chip_drives_is_no_reading_of_the_mcp3208():
    model = Mcp3208Model()
    model.absent = True
    assert kind_of(lambda: Mcp3208(model, 3.3, "x").begin()) == TRASH


@pytest.mark.parametrize("module", [ads1115, adc128d818])
def test_addresses_are_those_of_the_pins(module):
    assert list(module.ADDRESSES) in ([0x48, 0x49, 0x4A, 0x4B], [0x1D, 0x1E, 0x1F, 0x2D, 0x2E, 0x2F, 0x35, 0x36, 0x37])
