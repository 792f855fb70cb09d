# SPDX-License-Identifier: Apache-2.0
"""The scene of a flight as a component: state and estimates in, markers, pose and transforms out."""

from typing import Any, ClassVar

import numpy as np
from geometry_msgs.msg import PoseStamped

from css_common.actuator_sections import wheel_axes
from css_common.attitude import mrp_to_quaternion
from css_common.codec import Sample
from css_common.component import INERTIAL, Component, Input, Outgoing, Output, Received
from css_common.readings import Readings
from css_common.schema import Table, Values, integer, text
from css_common.vectors import vector_of
from css_msgs.msg import ControlStatus, CssVoltages, SpacecraftState, SunEstimate, WheelState
from css_sensors.cells import LARGEST_READING, NORMALS, SMALLEST_READING
from css_viewers.scene import Scene
from css_viewers.shapes import ORIGIN, UPRIGHT
from css_viewers.viewer_messages import marker_array, transforms

DIVIDER = integer("divider", 5, "-", "draws every so many control cycles", low=1, high=100_000)
LOCAL_FRAME = text("local_frame", "spacecraft", "frame_id of inertial axes at the spacecraft, in which to look at it")


class SceneComponent(Component):
    """Publishes what viewers draw; where a node of the flight is missing, what it would tell is left out.

    Class attributes:
        markers_type: class of visualization_msgs/MarkerArray.
        transforms_type: class of tf2_msgs/TFMessage; None: no transforms.
    """

    markers_type: ClassVar[type]
    transforms_type: ClassVar[type | None]
    shared: ClassVar[tuple[str, ...]] = ("spacecraft", "cells", "wheels", "graph")
    parameters: ClassVar[Table] = (DIVIDER, LOCAL_FRAME)

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        inputs = [Input("truth", "truth", SpacecraftState, frame=INERTIAL)]
        if len(values[NORMALS]):
            readings = {"voltages": Readings(values[SMALLEST_READING], values[LARGEST_READING])}
            lengths = {"voltages": len(values[NORMALS])}
            inputs.append(Input("cells", "css/voltages", CssVoltages, False, lengths=lengths, readings=readings))
            sun = f"{values.graph.estimator}/sun_estimate"
            inputs.append(Input("sun", sun, SunEstimate, False, used=("sun_b",)))
        if len(wheel_axes(values)):
            lengths = {"speed": len(wheel_axes(values))}
            inputs.append(Input("wheels", "wheels/state", WheelState, False, lengths=lengths, used=("speed",)))
        if any(node.startswith("sunpoint_control/") for node in values.graph.nodes):
            inputs.append(Input("status", "control/status", ControlStatus, False, used=("pointing_error",)))
        return tuple(inputs)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        every = values[DIVIDER]
        markers = Output("markers", f"{name}/markers", cls.markers_type, divider=every)
        pose = Output("pose", f"{name}/pose", PoseStamped, INERTIAL, divider=every)
        if cls.transforms_type is None:
            return markers, pose
        return markers, pose, Output("transforms", "tf", cls.transforms_type, INERTIAL, divider=every)

    def configure(self) -> None:
        local = self.values[LOCAL_FRAME]
        self._scene = Scene(self.values, self.values.io.body_frame, local)
        self._drawn: set[tuple[str, int]] = set()

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        truth = received["truth"]
        if truth is None or self.step_of(stamp_ns) % self.values[DIVIDER]:
            return {}
        shapes = self._scene.shapes(truth, dict(received))
        drawn = {(shape.group, shape.number) for shape in shapes}
        gone, self._drawn = sorted(self._drawn - drawn), drawn
        place, turn = vector_of(truth.r_n), mrp_to_quaternion(vector_of(truth.sigma_bn))
        given: dict[str, Sample] = {}
        if "transforms" in self.frames:  # first, for those who draw what comes in its order
            body, local = self._scene.frames
            links = ((self.values.io.inertial_frame, local, place, UPRIGHT), (local, body, ORIGIN, turn))
            given["transforms"] = self._tree("transforms", stamp_ns, transforms(stamp_ns, links))
        given["markers"] = self._tree("markers", stamp_ns, marker_array(stamp_ns, shapes, gone))
        given["pose"] = self.message("pose", stamp_ns, pose=np.array([*place, *turn]))
        return given

    def _tree(self, key: str, stamp_ns: int, message: Any) -> Sample:
        return Sample(stamp_ns, self.frames[key], message=message)
