# SPDX-License-Identifier: Apache-2.0
"""The Sun as the cells alone show it, without the help of any gyro: what the gyro is held against.

The direction that cells are judged by is carried along with the gyro, and one that lies takes it along; so does the
heading of an estimator. Here the Sun line filter of O'Keefe & Schaub flies without a gyro, as it does where there is
none, on the cells that can be trusted.
"""

from typing import Any

from css_common.declared import built
from css_common.kernel import kernel
from css_common.schema import Parameter, Values
from css_estimation.health.sight import Sight
from css_estimation.sun import sunline_ekf
from css_estimation.sun.sun_heading import VALIDITY_VALID, Aiding, Sky
from css_estimation.sun.sun_tracking import USE_GYRO
from css_estimation.sun.sunline_ekf import EkfParameters, EkfState

_SURE = 0.03  # [rad^2] per axis: 10 deg
_NO_RATE = (0.0, 0.0, 0.0)


class _WithoutGyro:
    """Values of an estimator, with the defaults of the filter for what it does not declare, and no gyro."""

    def __init__(self, values: Values) -> None:
        self._values = values

    def __getitem__(self, parameter: Parameter[Any]) -> Any:
        if parameter is USE_GYRO:
            return False
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


@kernel
def look(p: EkfParameters, state: EkfState, dt: float, voltages, speeds, sky: Sky) -> tuple[EkfState, Sight]:
    """State and sight after one cycle.

    Args:
        dt: [s] since the last cycle.
        voltages: (N,) [-] of cells that can be trusted, NaN for all others.
        speeds: (N,) of no wheels.
        sky: of the flight's models.
    """
    unaided = Aiding(_NO_RATE, False, _NO_RATE, False, speeds, False, sky)
    state, heading = sunline_ekf.step(p, state, None, dt, voltages, unaided)
    c = heading.covariance
    variance = 0.5 * (c[0] + c[4] + c[8])
    known = heading.validity == VALIDITY_VALID and state.started and variance < _SURE
    return state, Sight(heading.sun_b, variance, known)

