# SPDX-License-Identifier: Apache-2.0
"""Every component of every mission, flown for fifty cycles: its messages fit their types, and come again the same."""

import numpy as np
import pytest
from listing import MISSIONS, components, executable, mission_of

from css_analysis.configured_mission import configured
from css_common.codec import codec_of, type_name
from css_common.component import INERTIAL
from css_common.mission import load_mission
from css_estimation.sun.sun_estimator import SunEstimator
from css_monte_carlo.direct_flight import fly_and_keep

CYCLES = 50
STAND_INS = [executable(kind) for kind in components(base=SunEstimator) if mission_of(kind) is None]
"""Sun estimators that no mission has: they fly in the place of the default mission's."""


def flight_of(name):
    """A mission, or the default one with another estimator, cut to some cycles."""
    mission = load_mission(name) if name in MISSIONS else configured(load_mission("okeefe_2013"), estimator=name)
    return mission.with_overrides([f"mission.duration={CYCLES * mission.values.mission.period!r}"])


def test_every_component_flies_in_one_of_them():
    flown = {node.component for name in (*MISSIONS, *STAND_INS) for node in flight_of(name).nodes}
    # devices are paced by hardware, viewers are nobody's input: they have tests of their own
    others = {kind for kind in components() if kind.__module__.startswith(("css_drivers.", "css_viewers."))}
    assert flown == set(components()) - others


@pytest.mark.parametrize("name", [*MISSIONS, *STAND_INS])
def test_messages_fit_their_types_and_come_again_the_same(name):
    mission = flight_of(name)
    first, second = (fly_and_keep(mission, mission.topics) for _ in range(2))
    for node in mission.nodes:
        for output in node.outputs:
            samples, codec = first[output.topic], codec_of(output.message_type)
            encoded = [codec.encode(sample) for sample in samples]
            assert encoded == [codec.encode(sample) for sample in second[output.topic]], output.topic
            stamps = [sample.stamp_ns for sample in samples]
            if not output.events:
                due = range(0, CYCLES, output.divider)
                assert stamps == [mission.epoch_ns + k * mission.period_ns for k in due], output.topic
            io = node.values.io
            frame_id = io.inertial_frame if output.frame == INERTIAL else io.body_frame
            assert {sample.frame_id for sample in samples} <= {frame_id}, output.topic
            for sample, data in zip(samples, encoded, strict=True):
                again = codec.decode(data)
                for field in codec.fields:
                    np.testing.assert_array_equal(
                        getattr(again, field.name),
                        np.ravel(getattr(sample, field.name)).reshape(np.shape(getattr(again, field.name))),
                        f"{output.topic} {type_name(output.message_type)} {field.name}",
                    )
                assert codec.first_not_finite(codec.real_fields(), sample) is None, output.topic
