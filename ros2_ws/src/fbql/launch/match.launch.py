"""A match: `ros2 launch fbql match.launch.py goals:=3 realtime:=1.0`.

It is the match that `ros2 run fbql bringup` plays with the options of the same names: the same parameters, the same
processes, the same digest. It runs in the domain of this shell, and ends when fusion ends, or a node fails. What the
launcher adds there (a free domain, the start barrier, a node that hangs is named) is not here.
"""

from __future__ import annotations

from fbql.commands.bringup import parser
from fbql.graph.launch import Mode, commands, write_parameters
from fbql.match.in_process import rehearse
from fbql.match.options import make_run_directory, match_from
from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    LogInfo,
    OpaqueFunction,
    RegisterEventHandler,
    Shutdown,
)
from launch.event_handlers import OnProcessExit
from launch.substitutions import LaunchConfiguration

OPTIONS = (
    "controller", "preset", "episodes", "goals", "guided", "max_steps", "seed", "policy", "trees", "out", "realtime",
)  # fmt: skip


def generate_launch_description() -> LaunchDescription:
    """The arguments, and the graph that they describe."""
    arguments = [
        DeclareLaunchArgument(
            name, default_value="", description=f"as --{name.replace('_', '-')} of ros2 run fbql bringup"
        )
        for name in OPTIONS
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=graph)])


def graph(context: LaunchContext) -> list[ExecuteProcess | LogInfo | RegisterEventHandler]:
    """The processes of the match, none of which goes on without the others. Raises BadInput."""
    words: list[str] = []
    for name in OPTIONS:
        value = LaunchConfiguration(name).perform(context)
        words += [f"--{name.replace('_', '-')}", value] if value else []
    options = parser("match.launch.py").parse_args(words)
    match = match_from(options)
    rehearse(match)
    match = make_run_directory(match)
    mode = Mode("many", options.realtime, record=True)
    lines = commands(match, mode, write_parameters(match, mode))
    processes = [ExecuteProcess(cmd=line, name=name, output="screen") for name, line in lines.items()]
    ends = [
        RegisterEventHandler(OnProcessExit(target_action=process, on_exit=[Shutdown(reason=f"{name} ended")]))
        for process, name in zip(processes, lines, strict=True)
    ]
    return [LogInfo(msg=f"the run is recorded in {match.out}"), *ends, *processes]
