# SPDX-License-Identifier: Apache-2.0
"""Which converter a mission's cells hang on, how it is set, and what makes voltages of its outputs."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from css_common.mission_section import PERIOD
from css_common.schema import Table, Values, choice, integer, integers, real, reals, text, texts
from css_drivers import adc128d818, ads1115, mcp3208
from css_drivers.adc128d818 import Adc128d818
from css_drivers.ads1115 import Ads1115
from css_drivers.cell_source import CellSource, ChipSource, LineSource
from css_drivers.converter import Converter
from css_drivers.device_errors import GONE, DeviceError, of_device
from css_drivers.mcp3208 import Mcp3208
from css_drivers.text_line import LineFormat, usual_fields
from css_sensors.cells import NORMALS

ADS1115, ADC128D818, MCP3208, LINE = "ads1115", "adc128d818", "mcp3208", "line"
_CHANNELS = {ADS1115: Ads1115.channels, ADC128D818: Adc128d818.channels, MCP3208: Mcp3208.channels}

CONVERTER = choice("converter", ADS1115, (ADS1115, ADC128D818, MCP3208, LINE), "what the cells hang on")
INPUTS = integers(
    "inputs", (), "-", "input of each cell, counted through all chips; empty: in their order from 0", low=0, high=255
)
SCAN_PERIOD = real("scan_period", 0.0, "s", "time from scan to scan of a chip; 0: mission.period", low=0.0, high=60.0)
FULL_SCALE = reals(
    "full_scale",
    (1.0,),
    "V",
    "what a cell gives in the Sun at normal incidence at 1 AU above its dark level, one for all or one each; "
    "in the unit of a line where there is one",
    open_low=True,
    low=0.0,
)
DARK_LEVEL = reals("dark_level", (0.0,), "V", "what a cell gives in the dark, one for all or one each")
RETRY = real("retry", 0.5, "s", "time after which a bus that is gone is opened again", low=0.01, high=60.0)
STUCK_SCANS = integer(
    "stuck_scans", 100, "-", "so many scans without any change of a lit cell are said; 0: never", low=0, high=1_000_000
)
I2C_BUS = integer("i2c.bus", 1, "-", "number of the bus, /dev/i2c-N", low=0, high=255)
I2C_ADDRESSES = integers(
    "i2c.addresses",
    (0x48, 0x49),
    "-",
    "of the chips, in the order of their inputs; one without a cell need not be there",
    low=0,
    high=127,
)
ADS_RANGE = real("ads1115.range", 4.096, "V", "full scale: 6.144, 4.096, 2.048, 1.024, 0.512 or 0.256")
ADS_RATE = integer("ads1115.rate", 860, "1/s", "conversions a second: 8, 16, 32, 64, 128, 250, 475 or 860")
ADC_REFERENCE = real("adc128d818.reference", 0.0, "V", "external reference; 0: the internal 2.56 V", low=0.0, high=5.5)
SPI_BUS = integer("spi.bus", 0, "-", "bus of /dev/spidevBUS.DEVICE", low=0, high=255)
SPI_DEVICE = integer("spi.device", 0, "-", "chip select of /dev/spidevBUS.DEVICE", low=0, high=255)
SPI_CLOCK = integer("spi.clock", 1_000_000, "Hz", "clock of the bus", low=mcp3208.SLOWEST, high=mcp3208.FASTEST)
MCP_REFERENCE = real("mcp3208.reference", 3.3, "V", "reference voltage", low=0.0, open_low=True, high=5.5)
LINE_PORT = text("line.port", "/dev/ttyUSB0", "serial device, or a URL of pyserial")
LINE_BAUD = integer("line.baud", 115_200, "1/s", "bits a second", low=50, high=4_000_000)
LINE_PREFIX = text("line.prefix", "$CSS", "how a line begins; empty: with its first field")
LINE_SEPARATOR = text("line.separator", ",", "one character between fields")
LINE_CHECKSUM = choice("line.checksum", "xor", ("xor", "none"), "xor: * and two hexadecimal digits, as NMEA 0183")
LINE_FIELDS = texts("line.fields", (), "sequence, cell.K or - each; empty: sequence, then the cells in their order")
LINE_DELAY = real("line.delay", 0.0, "s", "from conversion to the end of its line", low=0.0, high=10.0)
LINE_PATIENCE = real("line.patience", 1.0, "s", "time without a line that is said", low=0.01, high=60.0)

PARAMETERS: Table = (
    CONVERTER,
    INPUTS,
    SCAN_PERIOD,
    FULL_SCALE,
    DARK_LEVEL,
    RETRY,
    STUCK_SCANS,
    I2C_BUS,
    I2C_ADDRESSES,
    ADS_RANGE,
    ADS_RATE,
    ADC_REFERENCE,
    SPI_BUS,
    SPI_DEVICE,
    SPI_CLOCK,
    MCP_REFERENCE,
    LINE_PORT,
    LINE_BAUD,
    LINE_PREFIX,
    LINE_SEPARATOR,
    LINE_CHECKSUM,
    LINE_FIELDS,
    LINE_DELAY,
    LINE_PATIENCE,
)


def inputs_of(values: Values) -> list[int]:
    """The input that each cell hangs on."""
    given = values[INPUTS].tolist()
    return given or list(range(len(values[NORMALS])))


def line_format(values: Values) -> LineFormat:
    """How the lines of a mission are written."""
    cells = len(values[NORMALS])
    fields = tuple(values.line.fields) or usual_fields(cells)
    return LineFormat(values[LINE_PREFIX], values[LINE_SEPARATOR], values[LINE_CHECKSUM], fields, cells)


def scan_period(values: Values) -> float:
    """Time from scan to scan [s]."""
    return values[SCAN_PERIOD] or values[PERIOD]


def cell_source(values: Values) -> CellSource:
    """What the cells are read from."""
    kind = values[CONVERTER]
    if kind == LINE:
        return LineSource(
            values[LINE_PORT], values[LINE_BAUD], line_format(values), values[LINE_DELAY], values[LINE_PATIENCE]
        )
    inputs = inputs_of(values)
    if kind == MCP3208:
        name = f"/dev/spidev{values[SPI_BUS]}.{values[SPI_DEVICE]}"
        return ChipSource(lambda: _open_spi(values, name), lambda spi: _spi_chips(values, spi, name), inputs)
    return ChipSource(lambda: _open_i2c(values[I2C_BUS]), lambda bus: _i2c_chips(values, bus), inputs)


def _open_i2c(number: int) -> Any:
    from smbus2 import SMBus

    with of_device(f"/dev/i2c-{number}"):
        return SMBus(number)


def _i2c_chips(values: Values, bus: Any) -> Sequence[Converter]:
    addresses = values[I2C_ADDRESSES].tolist()
    if values[CONVERTER] == ADS1115:
        return [Ads1115(bus, address, values[ADS_RANGE], values[ADS_RATE]) for address in addresses]
    each, inputs = Adc128d818.channels, inputs_of(values)
    return [
        Adc128d818(bus, address, values[ADC_REFERENCE], [i - each * k for i in inputs if i // each == k])
        for k, address in enumerate(addresses)
    ]


def _open_spi(values: Values, name: str) -> Any:
    try:
        import spidev
    except ImportError as error:
        raise DeviceError(GONE, f"{name}: Python has no spidev; pip install spidev brings it") from error
    spi = spidev.SpiDev()
    with of_device(name):
        spi.open(values[SPI_BUS], values[SPI_DEVICE])
        spi.mode, spi.max_speed_hz = 0b00, values[SPI_CLOCK]
    return spi


def _spi_chips(values: Values, spi: Any, name: str) -> Sequence[Converter]:
    return [Mcp3208(spi, values[MCP_REFERENCE], name)]


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between the values, one message each."""
    cells = len(values[NORMALS])
    for parameter in (FULL_SCALE, DARK_LEVEL):
        given = len(values[parameter])
        if given not in (1, cells):
            yield f"{parameter.name}: {given} values given, expected one or one for each of the {cells} cells"
    if values[CONVERTER] == LINE:
        yield from line_format(values).wrong()
    else:
        yield from _chip_conflicts(values, cells)


def _chip_conflicts(values: Values, cells: int) -> Iterator[str]:
    kind, inputs = values[CONVERTER], inputs_of(values)
    addresses = values[I2C_ADDRESSES].tolist()
    chips = 1 if kind == MCP3208 else len(addresses)
    there = chips * _CHANNELS[kind]
    if len(inputs) != cells or len(set(inputs)) != cells:
        yield f"inputs: {inputs} given, expected a different one for each of the {cells} cells"
    elif max(inputs, default=0) >= there:
        yield f"inputs: {max(inputs)} needed, expected at most {there - 1}: {chips} {kind} with {_CHANNELS[kind]} each"
    if kind == MCP3208:
        return
    allowed = ads1115.ADDRESSES if kind == ADS1115 else adc128d818.ADDRESSES
    wrong = [address for address in addresses if address not in allowed]
    if wrong or len(set(addresses)) != len(addresses):
        shown = ", ".join(map(hex, addresses))
        yield f"i2c.addresses: {shown} given, expected different ones of {', '.join(map(hex, allowed))}"
    if kind == ADS1115 and values[ADS_RANGE] not in ads1115.RANGES:
        yield f"ads1115.range: {values[ADS_RANGE]:g} given, expected one of {', '.join(map(str, ads1115.RANGES))} [V]"
    if kind == ADS1115 and values[ADS_RATE] not in ads1115.RATES:
        yield f"ads1115.rate: {values[ADS_RATE]} given, expected one of {', '.join(map(str, ads1115.RATES))} [1/s]"
    needed = _scan_time(values, inputs)
    if needed > scan_period(values):
        yield (
            f"scan_period: {scan_period(values):g} s given, but {len(inputs)} conversions of a {kind} take "
            f"{needed:.3g} s; expected at least that"
        )


def _scan_time(values: Values, inputs: Sequence[int]) -> float:
    """Time [s] that the conversions of one scan take at least, without what the bus needs."""
    per_input = 1.0 / values[ADS_RATE] if values[CONVERTER] == ADS1115 else adc128d818.PER_INPUT
    return len(inputs) * per_input


def calibration(values: Values) -> tuple[np.ndarray, np.ndarray]:
    """Dark level and full scale (N,) of the cells."""
    cells = len(values[NORMALS])
    dark, full = (np.broadcast_to(values[p], (cells,)) for p in (DARK_LEVEL, FULL_SCALE))
    return dark.copy(), full.copy()
