"""Writes docs/parameters.md from the declarations in the code. Run it in the project's environment:

source scripts/env.sh
python docs/make_parameters.py

tests/project/test_docs_parameters.py fails while the page is not what this would write.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from fbql_behaviors.behavior_node import BehaviorNodeParameters
from fbql_behaviors.core.induction import InductionParameters
from fbql_behaviors.core.teleop import TeleopParameters
from fbql_behaviors.twist_behavior_node import TwistBehaviorParameters
from fbql_common.core.parameters import Limits, defaults_of, limits_of, types_of
from fbql_common.files import write_atomically
from fbql_fusion.core.mux.parameters import (
    AxisParameters,
    LearnedMuxParameters,
    LockParameters,
    MuxParameters,
    ObservationParameters,
    SourceParameters,
)
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.tasks.twist.parameters import MuxLearningParameters
from fbql_fusion.node_parameters import FusionNodeParameters
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.simulator_node import SimulatorNodeParameters

PAGE = Path(__file__).with_name("parameters.md")

HEAD = """# Parameters

This page is written by `docs/make_parameters.py` from the declarations in the code, and a test compares the two:
change the declaration, not the page.

Parameters are read once, before the first step, and cannot be changed while a node runs. A misspelt name, a value of
another type and a value out of its range are each refused in one line, with exit code 2.

- A node takes them as ROS parameters: `--ros-args -p NAME:=VALUE`, or `--ros-args --params-file FILE`. There a decimal
  number needs its point: `0.0`, not `0`.
- `scripts/bringup.py` and `scripts/train.py` have options for the common ones. Their `--set NAME=VALUE` reaches every
  parameter of the two tables *The world* and *Fusion and learning*; lists are written with commas. A parameter that the
  chosen controller does not use is reported in one line.
- Every parameter in force is in the `config.yaml` of a run directory.
"""


class Section(NamedTuple):
    """One table of the page."""

    title: str
    text: str
    declaration: type[Any]


SECTIONS = (
    Section("The simulator node", "Node `simulator`.", SimulatorNodeParameters),
    Section("The world", "Node `simulator`: physics, start positions, disturbance, events.", SimulationParameters),
    Section(
        "The behavior nodes",
        "Nodes `ball_seeking`, `wall_avoiding`, `approaching` and `behavior`.",
        BehaviorNodeParameters,
    ),
    Section("The fusion node", "Node `fusion`: files, and what to do when an input is missing.", FusionNodeParameters),
    Section(
        "Fusion and learning",
        "Node `fusion`. [deviations.md](deviations.md) lists which of these the paper leaves open. Your own controller may "
        "have further ones. Where neither `controller` nor `preset` is given, commands and node play `fbql`; where neither "
        "`goals` nor `episodes` is, they play until 10 goals are scored.",
        FusionParameters,
    ),
    Section("The mux", "Node `twist_mux`. [mux.md](mux.md) explains them.", MuxParameters),
    Section("The sources of a mux", "Node `twist_mux`, as `topics.NAME.PARAMETER` for each source.", SourceParameters),
    Section("The locks of a mux", "Node `twist_mux`, as `locks.NAME.PARAMETER` for each lock.", LockParameters),
    Section("A mux that learns", "Node `twist_mux`: what it is connected to, and what it keeps.", LearnedMuxParameters),
    Section("What a mux learns", "Node `twist_mux`: how it decides and learns.", MuxLearningParameters),
    Section(
        "The observations of a mux",
        "Node `twist_mux`, as `observations.NAME.PARAMETER` for each observation.",
        ObservationParameters,
    ),
    Section(
        "The axes of a mux",
        "Node `twist_mux`, as `axes.NAME.PARAMETER` for each axis; without any: `linear_x` from -1 to 1 m/s and `angular_z` "
        "from -2 to 2 rad/s.",
        AxisParameters,
    ),
    Section(
        "The node of a tree from a bag",
        "Node `twist_behavior`. [bags.md](bags.md) explains it.",
        TwistBehaviorParameters,
    ),
    Section("Keyboard teleoperation", "Node `teleop`.", TeleopParameters),
    Section(
        "Induction of trees",
        "No node has these: they determine how a tree is made from demonstrations. The shipped trees differ from these "
        "defaults where `fbql_behaviors.core.recipes.RECIPES` sets other values.",
        InductionParameters,
    ),
)

_KINDS = {bool: "true or false", int: "whole number", float: "decimal number", str: "text", list[str]: "list of texts"}


def page() -> str:
    """The whole page."""
    return HEAD + "".join(map(_section, SECTIONS))


def _section(section: Section) -> str:
    names = limits_of(section.declaration)
    kinds, defaults = types_of(section.declaration), defaults_of(section.declaration)
    columns = ["name", "type", "default", "may be", "meaning"]
    has_owners = any(limits.owners for limits in names.values())
    if has_owners:
        columns.insert(4, "used by")
    lines = [columns, ["---"] * len(columns)]
    for name, limits in names.items():
        default = "required" if limits.required else _value(defaults[name])
        cells = [f"`{name}`", _KINDS[kinds[name]], default, _range(kinds[name], limits)]
        owners = [", ".join(f"`{owner}`" for owner in limits.owners) or "all"] if has_owners else []
        lines.append([*cells, *owners, _cell(limits.description)])
    head, ruler, *rows = ["| " + " | ".join(line) + " |\n" for line in lines]
    table = head + ruler.replace(" ", "") + "".join(rows)
    return f"\n## {section.title}\n\n{section.text} Declared in `{_place(section)}`.\n\n{table}"


def _place(section: Section) -> str:
    return f"{section.declaration.__module__}.{section.declaration.__qualname__}"


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, float):
        return f"`{_decimal(value)}`"
    if isinstance(value, list):
        return ", ".join(f"`{item}`" for item in value) or "empty"
    return f"`{value}`" if value != "" else "empty"


def _range(kind: Any, limits: Limits) -> str:
    if limits.choices is not None:
        return ", ".join(f"`{choice}`" for choice in limits.choices)
    written = _decimal if kind is float else _whole
    unit = f" {limits.unit.replace('^2', '²')}" if limits.unit else ""
    if limits.low is None:
        return "" if limits.high is None else f"{written(limits.high)}{unit} or less"
    if limits.high is None:
        return f"{written(limits.low)}{unit} or more"
    return f"{written(limits.low)} to {written(limits.high)}{unit}"


def _decimal(value: float) -> str:
    text = f"{value:.6g}".replace("e+0", "e").replace("e-0", "e-")
    return text if "." in text or "e" in text else f"{text}.0"


def _whole(value: float) -> str:
    return "2^63 - 1" if value == 2**63 - 1 else f"{value:,}"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "\\<")


if __name__ == "__main__":
    write_atomically(PAGE, page().encode())
    print(f"wrote {PAGE}")
