"""Fusion: `ros2 launch fbql_fusion fusion.launch.py controller:=subsumption episodes:=3`."""

from __future__ import annotations

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue


def generate_launch_description() -> LaunchDescription:
    """The node, with the parameters that are chosen most often. `ros2 run fbql_fusion fusion --help` lists all."""
    kinds = {"controller": str, "episodes": int, "seed": int, "run_directory": str}
    return LaunchDescription(
        [
            DeclareLaunchArgument("controller", default_value="fbql", description="who decides"),
            DeclareLaunchArgument("episodes", default_value="10", description="episodes to play"),
            DeclareLaunchArgument("seed", default_value="0", description="seed of the run"),
            DeclareLaunchArgument("run_directory", default_value="", description="where the run is recorded"),
            Node(
                package="fbql_fusion",
                executable="fusion",
                output="screen",
                parameters=[
                    {name: ParameterValue(LaunchConfiguration(name), value_type=kind) for name, kind in kinds.items()}
                ],
            ),
        ]
    )
