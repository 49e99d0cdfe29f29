"""Fusion: `ros2 launch fbql_fusion fusion.launch.py controller:=subsumption episodes:=3`."""

from __future__ import annotations

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

PARAMETERS = {"controller": str, "policy": str, "episodes": int, "goals": int, "seed": int, "run_directory": str}
"""Those that are chosen most often. `ros2 run fbql_fusion fusion --help` lists all."""


def generate_launch_description() -> LaunchDescription:
    """The arguments, and the node."""
    arguments = [
        DeclareLaunchArgument(name, default_value="", description=f"parameter '{name}'; empty: the node's default")
        for name in PARAMETERS
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=fusion)])


def fusion(context: LaunchContext) -> list[Node]:
    """The node, with the parameters that were given: it plays what bringup plays where it is given nothing else."""
    given = {
        name: ParameterValue(LaunchConfiguration(name), value_type=kind)
        for name, kind in PARAMETERS.items()
        if LaunchConfiguration(name).perform(context)
    }
    return [Node(package="fbql_fusion", executable="fusion", output="screen", parameters=[given] if given else None)]
