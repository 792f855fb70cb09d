# SPDX-License-Identifier: Apache-2.0
"""Flight in the form that RViz, Foxglove and their like draw."""

from typing import ClassVar

from visualization_msgs.msg import MarkerArray

from css_common.run import node_main
from css_viewers.visualizer import SceneComponent

try:  # RViz's own message is no part of the smallest ROS
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None


class Visualizer(SceneComponent):
    """Spacecraft, cells with their views, wheels, Earth, and the Sun as it is and as it is estimated, as markers.

    Its pose is that of the spacecraft in its orbit. Transforms, on `tf`, are published where `tf2_msgs` is installed:
    from the inertial frame to inertial axes at the spacecraft (`local_frame`), from there to the body.
    """

    markers_type: ClassVar[type] = MarkerArray
    transforms_type: ClassVar[type | None] = TFMessage


main = node_main(Visualizer)
