"""How the graph of a match is launched: the command line of each process, and the parameters of each node."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from ament_index_python.packages import get_package_prefix
from fbql_common.core.errors import BadInput
from fbql_common.core.topic_names import WHEEL_COMMAND
from fbql_common.files import remedy, write_atomically

from fbql.match.in_process import own_observation
from fbql.match.options import Match

LOCKSTEP_TIMEOUT_S = 10.0
"""How long a step may take in a supervised graph before the run ends with the name of the node that is missing [s]."""
_START_GRACE_S = 5.0
PACED_COMMAND = "watch/wheel_command"
"""The topic on which the simulator of a paced match receives its commands, which are passed on when they are due."""


class Mode(NamedTuple):
    """How a match is run as a graph."""

    processes: str
    """many: one process per node; one: one process for all of them."""
    realtime: float
    """Speed relative to real time; 0: lockstep."""
    record: bool
    start_timeout_s: float = 30.0
    """How long the graph may take to come up [s]."""
    paced: bool = False
    """Lockstep: whether somebody sets the pace, by passing commands on to the simulator when they are due."""


def node_names(match: Match) -> list[str]:
    """Every node of the graph."""
    return ["simulator", *match.behaviors, "fusion"]


def write_parameters(match: Match, mode: Mode) -> Path:
    """Writes the parameters of every node as a ROS parameter file. Raises BadInput if it can't be written."""
    path = match.out / "log" / "parameters.yaml"
    nodes: dict[str, dict[str, Any]] = {
        "simulator": {
            **asdict(match.simulation),
            "seed": match.fusion.seed,
            "realtime": float(mode.realtime),
            # A little longer than fusion's: fusion can name the behavior that is missing.
            # Whoever sets the pace may pause: the launcher sees then whether a node hangs.
            "lockstep_timeout_s": 0.0 if mode.paced else LOCKSTEP_TIMEOUT_S + 2.0,
        },
        "fusion": {
            **asdict(match.fusion),
            "run_directory": str(match.out),
            "record": mode.record,
            "policy": str(match.policy or ""),
            "controller_file": match.controller_file,
            "tree_files": [str(file) for file in match.behaviors.values()],
            "config_file": str(path),
            # In a supervised lockstep run nothing continues without a behavior: the run ends with its name.
            "behavior_timeout_s": 0.1 if mode.realtime > 0 else 0.0,
            "lockstep_timeout_s": LOCKSTEP_TIMEOUT_S,
            # The start barrier names nodes that are absent; fusion names those that are present and can't be heard.
            "start_timeout_s": mode.start_timeout_s + _START_GRACE_S,
        },
    }
    for name, tree_file in match.behaviors.items():
        nodes[name] = {"tree_file": str(tree_file), **own_observation(match, name)}
    document = {f"/{name}": {"ros__parameters": parameters} for name, parameters in nodes.items()}
    try:
        write_atomically(path, yaml.safe_dump(document, sort_keys=False).encode())
    except OSError as error:
        raise BadInput(f"{path}: can't be written ({error.strerror}); {remedy(error)}") from None
    except UnicodeEncodeError:
        raise BadInput(
            f"{path}: the path of a file that the run uses is not UTF-8; a parameter can't hold it"
        ) from None
    return path


def write_domain(match: Match, export: str) -> Path:
    """Writes what joins a second shell to the graph, for `source`. Raises BadInput if it can't be written."""
    path = match.out / "log" / "domain.sh"
    text = f"# The ROS domain of this match, for `source` in a second shell while it is played.\n{export}\n"
    try:
        write_atomically(path, text.encode())
    except OSError as error:
        raise BadInput(f"{path}: can't be written ({error.strerror}); {remedy(error)}") from None
    return path


def commands(match: Match, mode: Mode, parameters: Path) -> dict[str, list[str]]:
    """The command line of each process of the graph; the last one holds the fusion node. Raises BadInput."""
    # What a node prints is kept; the logging library would write a second copy.
    ros = ["--ros-args", "--params-file", str(parameters), "--disable-external-lib-logs"]
    paced = f"{WHEEL_COMMAND}:={PACED_COMMAND}"
    if mode.processes == "one":
        ros += ["-r", f"simulator:{paced}"] if mode.paced else []
        program = str(Path(__file__).with_name("one_process.py"))
        return {"graph": [sys.executable, "-P", program, *match.behaviors, *ros]}
    result = {"simulator": [executable("fbql_sim", "simulator"), *ros, *(["-r", paced] if mode.paced else [])]}
    for name in match.behaviors:
        own = executable("fbql_behaviors", name, required=False)
        result[name] = [own or executable("fbql_behaviors", "behavior"), *ros]
        if not own:
            result[name] += ["-r", f"__node:={name}", "-p", f"name:={name}"]
    return {**result, "fusion": [executable("fbql_fusion", "fusion"), *ros]}


def executable(package: str, name: str, required: bool = True) -> str:
    """The file that `ros2 run PACKAGE NAME` would run; "" if there is none and none is required. Raises BadInput."""
    path = Path(get_package_prefix(package)) / "lib" / package / name
    if path.is_file():
        return str(path)
    if required:
        raise BadInput(f"package '{package}' has no executable '{name}'; build the workspace again")
    return ""
