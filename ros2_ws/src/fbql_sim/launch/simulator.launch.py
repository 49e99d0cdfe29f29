"""The simulator: `ros2 launch fbql_sim simulator.launch.py realtime:=1.0`."""

from __future__ import annotations

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue


def generate_launch_description() -> LaunchDescription:
    """The node, with the parameters that are chosen most often. `ros2 run fbql_sim simulator --help` lists all."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "realtime", default_value="0.0", description="speed relative to real time; 0: lockstep"
            ),
            DeclareLaunchArgument("seed", default_value="0", description="seed of the run"),
            Node(
                package="fbql_sim",
                executable="simulator",
                output="screen",
                parameters=[
                    {
                        "realtime": ParameterValue(LaunchConfiguration("realtime"), value_type=float),
                        "seed": ParameterValue(LaunchConfiguration("seed"), value_type=int),
                    }
                ],
            ),
        ]
    )
