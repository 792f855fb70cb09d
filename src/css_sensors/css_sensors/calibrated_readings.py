# SPDX-License-Identifier: Apache-2.0
"""What sensors read once a calibration of theirs is taken off: `measured` in the sections cells, gyro and magnetometer.

    cells: (v - dark) / (scale (1 + kappa (T - T0))),    gyro: omega - bias,    magnetometer: M^-1 (b - bias)

Whoever hears one of these sensors in flight takes its readings from here. Where nothing was calibrated they are handed
on as they are, to the last bit. The normals that a calibration found are `css_sensors.cells.known_normals`. Where there
are temperature coefficients and no temperature is heard, scales are those at the reference temperature, and
`CalibratedReadings.warning` says so.
"""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from sensor_msgs.msg import Temperature

from css_common.codec import Sample
from css_common.component import Finding, Input
from css_common.mission_extends import sections_alone
from css_common.mission_file import MissionError
from css_common.schema import Values
from css_common.sections import MEASURED_FIELD_BIAS, MEASURED_FIELD_MATRIX, MEASURED_GYRO_BIAS
from css_common.vectors import Vec3, vector_of
from css_sensors.cells import (
    MEASURED_COEFFICIENTS,
    MEASURED_DARKS,
    MEASURED_NORMALS,
    MEASURED_SCALES,
    MEASURED_TEMPERATURE,
)
from css_sensors.corrections import corrections, given, of_field, of_output, of_rate

if TYPE_CHECKING:
    from css_common.mission_node import Node

TEMPERATURE_TOPIC = "css/temperature"
HELD_S = 600.0
"""Time [s] for which a temperature stands for the one there is: cells of a spacecraft change by some kelvin in it."""

_MEASURED = ".measured."
_NO_ESTIMATE = -1.0  # first element of a covariance: the quantity is not measured
_NOTHING: Vec3 = (0.0, 0.0, 0.0)


def temperature_inputs(values: Values) -> tuple[Input, ...]:
    """The temperature of the cells, for a component whose calibration has coefficients; none without."""
    if not len(values[MEASURED_COEFFICIENTS]):
        return ()
    used = ("temperature",)
    return (Input("temperature", TEMPERATURE_TOPIC, Temperature, required=False, used=used, held_s=HELD_S),)


def temperature_findings(values: Values, graph: Mapping[str, "Node"]) -> Iterator[Finding]:
    """Before a flight: a calibration has temperature coefficients, and no node tells the temperature."""
    topics = {output.topic for node in graph.values() for output in node.outputs}
    if len(values[MEASURED_COEFFICIENTS]) and TEMPERATURE_TOPIC not in topics:
        yield Finding(
            f"{MEASURED_COEFFICIENTS.name}: no node of the mission publishes {TEMPERATURE_TOPIC}; unless a driver "
            f"does, scales are those at {values[MEASURED_TEMPERATURE]:g} deg C"
        )


def warm_scales(coefficients: np.ndarray, temperature: np.ndarray | float, reference: float) -> np.ndarray:
    """Factors (..., N) of scales at temperatures (...,) [deg C]; not below a tenth, which no cell is left with."""
    warmth = np.asarray(temperature, dtype=np.float64)[..., np.newaxis] - reference
    return np.maximum(1.0 + coefficients * warmth, 0.1)


class CalibratedReadings:
    """Corrections of one spacecraft.

    Attributes:
        cool: outputs that were corrected by the scales at the reference temperature, as no temperature was heard.
        warm: outputs that were corrected by a temperature.
    """

    def __init__(self, values: Values) -> None:
        """Takes the sections cells, gyro and magnetometer, as far as they are there."""
        self.cool = self.warm = 0
        self._c = corrections(values)
        self._coefficients = given(values, MEASURED_COEFFICIENTS)
        self._reference = float(values[MEASURED_TEMPERATURE]) if self._c.of_cells else 0.0

    @property
    def warning(self) -> str:
        """What of the calibration was not applied, in one line; empty: nothing."""
        if not self.cool:
            return ""
        heard = f"in {self.cool} of {self.cool + self.warm} cycles" if self.warm else "at any time"
        return (
            f"cells.measured.temperature_coefficients: no temperature ({TEMPERATURE_TOPIC}) was heard {heard}, where "
            f"scales are those at {self._reference:g} deg C"
        )

    def cells(self, voltages: np.ndarray, temperature: Sample | None = None) -> np.ndarray:
        """Outputs (..., N) at a temperature of the cells; None: nobody knows it."""
        if not self._c.of_cells:
            return voltages
        scales = self._c.scales
        if len(self._coefficients):
            cycles = voltages.size // max(1, voltages.shape[-1])
            if temperature is None:
                self.cool += cycles
            else:
                self.warm += cycles
                scales = scales * warm_scales(self._coefficients, temperature.temperature, self._reference)
        return np.asarray(of_output(voltages, self._c.darks, scales))

    def rates(self, rates_b: np.ndarray) -> np.ndarray:
        """Body rates (..., 3) [rad/s]."""
        return self._of_each(of_rate, rates_b) if self._c.of_gyro else rates_b

    def fields(self, fields_b: np.ndarray) -> np.ndarray:
        """Fields (..., 3) [T]."""
        return self._of_each(of_field, fields_b) if self._c.of_field else fields_b

    def rate(self, imu: Sample | None) -> tuple[Vec3, bool]:
        """Body rate [rad/s] of a sensor_msgs/Imu and whether it is a measurement.

        A gyro that is switched off says so by the message's own convention, a first covariance element of -1.
        """
        if imu is None or imu.angular_velocity_covariance[0] == _NO_ESTIMATE:
            return _NOTHING, False
        return vector_of(self.rates(imu.angular_velocity)), True

    def field(self, field: Sample | None) -> tuple[Vec3, bool]:
        """Field [T] of a sensor_msgs/MagneticField and whether it is a measurement, by the same convention."""
        if field is None or field.magnetic_field_covariance[0] == _NO_ESTIMATE:
            return _NOTHING, False
        return vector_of(self.fields(field.magnetic_field)), True

    def _of_each(self, corrected: Callable[..., Any], vectors: np.ndarray) -> np.ndarray:
        return np.stack(corrected(self._c, *np.moveaxis(vectors, -1, 0)), axis=-1)


def calibration_sections(path: str | Path) -> dict[str, dict[str, Any]]:
    """Flat parameters of each section of a file that `calibrate` wrote, for `Mission.with_sections`.

    Raises:
        MissionError: it cannot be read, or tells nothing of any sensor.
    """
    sections = sections_alone(path)
    if not any(_MEASURED in name for parameters in sections.values() for name in parameters):
        raise MissionError(
            f"{path}: tells nothing of a sensor, expected cells.measured, gyro.measured or magnetometer.measured, as "
            "`calibrate --out` writes them"
        )
    return sections


def is_calibrated(values: Values) -> bool:
    """Whether readings are corrected, or normals are others than those of the layout."""
    parameters = (
        MEASURED_NORMALS,
        MEASURED_SCALES,
        MEASURED_DARKS,
        MEASURED_COEFFICIENTS,
        MEASURED_GYRO_BIAS,
        MEASURED_FIELD_BIAS,
        MEASURED_FIELD_MATRIX,
    )
    return any(parameter in values and len(values[parameter]) for parameter in parameters)
