# SPDX-License-Identifier: Apache-2.0
"""Checks of simulated sensors before a flight: errors in which the measurement drowns."""

from collections.abc import Iterator

from css_common.component import Finding
from css_common.schema import Parameter, Values

LOUDEST_CELL = 0.3
"""1 sigma of a cell's output: the level below which estimators take no cell for one that sees the Sun."""

LOUDEST_GYRO_DEG_S = 5.0
"""1 sigma of a body rate [deg/s]: the rate at which a control goes over from damping to pointing."""

LOUDEST_FIELD_NT = 20_000.0
"""1 sigma of a field component [nT]: the weakest field that a low orbit meets."""


def noise_findings(noise: Parameter[float], values: Values, loudest: float) -> Iterator[Finding]:
    """A warning for noise in which nothing can be seen."""
    if values[noise] > loudest:
        most = f"{loudest:g}" if noise.unit == "-" else f"{loudest:g} {noise.unit}"
        yield Finding(f"{noise.name}: {values[noise]:g} given, expected at most {most}: the measurement drowns in it")
