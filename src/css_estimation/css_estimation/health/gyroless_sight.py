# SPDX-License-Identifier: Apache-2.0
"""The Sun as the cells alone show it, without the help of any gyro: what the gyro is held against.

The direction that cells are judged by is carried along with the gyro, and one that lies takes it along; so does the
heading of an estimator. Here the Sun line filter of O'Keefe & Schaub flies without a gyro, as it does where there is
none, on the cells that can be trusted.
"""

import math
from typing import Any, NamedTuple

from css_common.declared import built
from css_common.kernel import kernel
from css_common.schema import Parameter, Values
from css_common.vectors import Vec3
from css_estimation.health.sight import Sight
from css_estimation.sun import sunline_ekf
from css_estimation.sun.sun_heading import VALIDITY_VALID, Aiding, Sky
from css_estimation.sun.sun_tracking import USE_GYRO
from css_estimation.sun.sunline_ekf import EkfParameters, EkfState
from css_estimation.symmetric import Symmetric, trace

_SURE = 0.01  # [rad^2] along the better axis: 6 deg
# Where one or two cells see the Sun, the direction that they do not tell has to get uncertain as fast as a body turns
# that nothing is known of.
_INSTEAD = {"process_sigma": 0.05}
_NO_RATE = (0.0, 0.0, 0.0)


class _WithoutGyro:
    """Values of an estimator, with the defaults of the filter for what it does not declare, and no gyro."""

    def __init__(self, values: Values) -> None:
        self._values = values

    def __getitem__(self, parameter: Parameter[Any]) -> Any:
        if parameter is USE_GYRO:
            return False
        if parameter.name in _INSTEAD:
            return _INSTEAD[parameter.name]
        return self._values[parameter] if parameter in self._values else _converted(parameter)

    def __contains__(self, parameter: Parameter[Any]) -> bool:
        return True

    def __getattr__(self, name: str) -> Any:
        return getattr(self._values, name)


def _converted(parameter: Parameter[Any]) -> Any:
    return parameter.check(parameter.default)


def gyroless_parameters(values: Values) -> EkfParameters:
    """Of the filter, for the cells of a mission."""
    return built(EkfParameters, _WithoutGyro(values))  # type: ignore[arg-type]


def initial_state(p: EkfParameters) -> EkfState:
    """Waiting for light."""
    return sunline_ekf.initial_state(p)


class Glimpse(NamedTuple):
    """Direction to the Sun by cells without a gyro, of the last cycle."""

    sun_b: Vec3  # [-] unit vector
    covariance: Symmetric  # [rad^2] next to nothing along it
    known: bool


@kernel
def glimpse_of(sight: Sight) -> Glimpse:
    """A sight that is known equally well across."""
    x, y, z = sight.sun_b
    v = sight.variance
    covariance = (v - v * x * x, -v * x * y, -v * x * z, v - v * y * y, -v * y * z, v - v * z * z)
    return Glimpse(sight.sun_b, covariance, sight.known)


@kernel
def look(p: EkfParameters, state: EkfState, dt: float, voltages, speeds, sky: Sky) -> tuple[EkfState, Glimpse]:
    """State and sight after one cycle.

    Args:
        dt: [s] since the last cycle.
        voltages: (N,) [-] of cells that can be trusted, NaN for all others.
        speeds: (0,) of no wheels.
        sky: of the flight's models.
    """
    unaided = Aiding(_NO_RATE, False, _NO_RATE, False, speeds, False, sky)
    state, heading = sunline_ekf.step(p, state, None, dt, voltages, unaided)
    known = heading.validity == VALIDITY_VALID and state.started
    return state, Glimpse(heading.sun_b, state.covariance, known and least_across(state.covariance) < _SURE)


@kernel
def least_across(p: Symmetric) -> float:
    """The smaller of the two variances across a direction, of a covariance that has next to none along it."""
    half = 0.5 * trace(p)
    product = p[0] * p[3] - p[1] * p[1] + p[0] * p[5] - p[2] * p[2] + p[3] * p[5] - p[4] * p[4]
    return half - math.sqrt(max(half * half - product, 0.0))
