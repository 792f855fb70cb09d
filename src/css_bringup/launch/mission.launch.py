# SPDX-License-Identifier: Apache-2.0
"""Launches the nodes of a mission: ros2 launch css_bringup mission.launch.py mission:=okeefe_2013."""

from launch.actions import DeclareLaunchArgument, EmitEvent, OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from css_common.mission import find_mission, load_mission
from launch import LaunchContext, LaunchDescription


def _nodes(context: LaunchContext) -> list:
    name = LaunchConfiguration("mission").perform(context)
    mission = load_mission(name)
    actions = []
    for node in mission.nodes:
        action = Node(
            package=node.package,
            executable=node.executable,
            name=node.name,
            parameters=[str(find_mission(name))],
            output="screen",
        )
        actions.append(action)
        if node is mission.plant:
            over = EmitEvent(event=Shutdown(reason="the flight is over"))
            actions.append(RegisterEventHandler(OnProcessExit(target_action=action, on_exit=[over])))
    return actions


def generate_launch_description() -> LaunchDescription:
    """The nodes of `graph.nodes`, each with the mission file as its parameters."""
    argument = DeclareLaunchArgument("mission", default_value="okeefe_2013", description="name in config/ or a file")
    return LaunchDescription([argument, OpaqueFunction(function=_nodes)])
