"""A behavior: `ros2 launch fbql_behaviors behavior.launch.py name:=ball_seeking`, or one of your own, with its tree_file."""

from __future__ import annotations

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition, UnlessCondition
from launch.substitutions import EqualsSubstitution, LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue


def generate_launch_description() -> LaunchDescription:
    """The node, which plays a tree file, or the shipped tree of the behavior's name."""
    name, tree_file = LaunchConfiguration("name"), LaunchConfiguration("tree_file")
    ships = EqualsSubstitution(tree_file, "")
    return LaunchDescription(
        [
            DeclareLaunchArgument("name", description="name of the behavior, and of its node"),
            DeclareLaunchArgument("tree_file", default_value="", description="its tree; empty: the shipped one"),
            Node(package="fbql_behaviors", executable=name, output="screen", condition=IfCondition(ships)),
            Node(
                package="fbql_behaviors",
                executable="behavior",
                name=name,
                output="screen",
                parameters=[
                    {
                        "name": ParameterValue(name, value_type=str),
                        "tree_file": ParameterValue(tree_file, value_type=str),
                    }
                ],
                condition=UnlessCondition(ships),
            ),
        ]
    )
