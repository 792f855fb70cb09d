# SPDX-License-Identifier: Apache-2.0
"""Shadow of the Earth as the flight's own orbit model predicts it, for estimators that may ask for it."""

from css_common.epochs import parse_utc
from css_common.schema import Values
from css_environment.mission_environment import MissionEnvironment
from css_estimation.sun.sun_heading import PREDICTION_ECLIPSED, PREDICTION_SUNLIT

# Half of the solar disc: the middle of the penumbra.
_HALF = 0.5


class EclipsePrediction:
    """Prediction along the orbit of the mission's `orbit` section."""

    def __init__(self, values: Values) -> None:
        self._environment = MissionEnvironment(values, field=False)
        self._epoch_ns = parse_utc(values.mission.epoch)

    def at(self, stamp_ns: int) -> int:
        """`PREDICTION_*` at a stamp [ns of UTC]."""
        illumination = self._environment.at((stamp_ns - self._epoch_ns) * 1e-9).illumination
        return PREDICTION_ECLIPSED if illumination < _HALF else PREDICTION_SUNLIT
