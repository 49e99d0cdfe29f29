"""`--help` of every node: what it does and every parameter, before anything is started."""

from __future__ import annotations

import sys
from collections.abc import Callable

import fbql_behaviors.programs
import fbql_fusion.programs
import fbql_sim.programs
import pytest
from fbql_behaviors.behavior_node import BehaviorNodeParameters
from fbql_behaviors.core.teleop import TeleopParameters
from fbql_behaviors.twist_behavior_node import TwistBehaviorParameters
from fbql_common.core.parameters import limits_of
from fbql_common.node_help import asks_for_help
from fbql_fusion.core.mux.parameters import LearnedMuxParameters, MuxParameters
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.tasks.twist.parameters import MuxLearningParameters
from fbql_fusion.node_parameters import FusionNodeParameters
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.simulator_node import SimulatorNodeParameters


@pytest.mark.parametrize(
    ("program", "declarations"),
    [
        (fbql_sim.programs.simulator, (SimulatorNodeParameters, SimulationParameters)),
        (fbql_behaviors.programs.approaching, (BehaviorNodeParameters,)),
        (fbql_behaviors.programs.behavior, (BehaviorNodeParameters,)),
        (fbql_behaviors.programs.teleop, (TeleopParameters,)),
        (fbql_fusion.programs.fusion, (FusionNodeParameters, FusionParameters)),
        (fbql_fusion.programs.twist_mux, (MuxParameters, LearnedMuxParameters, MuxLearningParameters)),
        (fbql_behaviors.programs.twist_behavior, (TwistBehaviorParameters,)),
    ],
)
def test_help_names_every_parameter_with_its_meaning_and_starts_nothing(
    program: Callable[[], int],
    declarations: tuple[type, ...],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", [f"/somewhere/{program.__name__}", "--help"])
    assert program() == 0
    said = capsys.readouterr().out
    assert said.startswith(f"usage: {program.__name__} [-h] [--ros-args -p NAME:=VALUE")
    for declaration in declarations:
        for name, limits in limits_of(declaration).items():
            line = next(line for line in said.splitlines() if line.startswith(f"  {name} ("))
            assert limits.description in line
            assert f"[{limits.unit}]" in line or not limits.unit


def test_what_is_meant_for_ros_is_no_request_for_help() -> None:
    assert asks_for_help(["-h"])
    assert asks_for_help(["--help", "--ros-args", "-p", "seed:=1"])
    assert not asks_for_help(["--ros-args", "-p", "name:=x", "--help"])
    assert not asks_for_help([])
