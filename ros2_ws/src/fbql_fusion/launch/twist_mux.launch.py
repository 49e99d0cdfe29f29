"""The mux: `ros2 launch fbql_fusion twist_mux.launch.py config:=twist_mux.yaml cmd_vel_out:=/cmd_vel`."""

from __future__ import annotations

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    """The node, with a parameter file of twist_mux."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("config", description="parameter file with topics and locks"),
            DeclareLaunchArgument(
                "cmd_vel_out", default_value="cmd_vel_out", description="topic of the robot's velocity commands"
            ),
            Node(
                package="fbql_fusion",
                executable="twist_mux",
                output="screen",
                parameters=[LaunchConfiguration("config")],
                remappings=[("cmd_vel_out", LaunchConfiguration("cmd_vel_out"))],
            ),
        ]
    )
