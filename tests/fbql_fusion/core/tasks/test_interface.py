"""Fusion knows no soccer: another task, with other axes, leaves and outcomes, is played and learned by the same core."""

from __future__ import annotations

import ast
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import fbql_fusion.core
import numpy as np
import pytest
from fbql_common.core.command_space import Axis, Command, CommandSpace
from fbql_common.core.types import DRIVER_BLEND, Phase
from fbql_fusion.core.controllers.interface import Selection
from fbql_fusion.core.guides.layers import Layer, driver_of
from fbql_fusion.core.learners.ppo.parameters import FbqlParameters
from fbql_fusion.core.registry import make_controller
from fbql_fusion.core.session import Session
from fbql_fusion.core.tasks.interface import Answers, Episode, Outcome

CORE = Path(fbql_fusion.core.__file__).parent
OF_SOCCER = {"World", "WheelCommand", "fbql_common.core.field", "fbql_common.core.geometry"}
TWIST = CommandSpace((Axis("linear.x", "m/s", -0.8, 0.8, 5), Axis("angular.z", "rad/s", -1.5, 1.5, 5)))


class Tick(NamedTuple):
    """A robot on a line, somewhere in -1 .. 1, that should get to +1."""

    stamp_ns: int
    episode: int
    step: int
    x_m: float
    terminated: bool
    truncated: bool

    @property
    def ended(self) -> bool:
        return self.terminated or self.truncated


class Source(NamedTuple):
    command: Command
    leaf_id: int
    leaf_count: int
    tree_hash: str
    clamped: bool
    observation: tuple[float, ...]
    active: bool


class Line:
    """Reaching +1 is a success, -1 a failure."""

    space = TWIST
    period_s = 1.0 / 60.0
    observed_lengths = None
    critic_widths = ()

    def begin_episode(self) -> None:
        pass

    def observed(self, tick: Tick, answers: Answers) -> tuple[tuple[float, ...], ...]:
        return tuple([() if x is None else x.observation for x in answers])

    def reward(self, tick: Tick) -> float:
        return 10.0 * np.sign(tick.x_m) if tick.terminated else 0.0

    def outcome(self, tick: Tick) -> Outcome:
        if not tick.terminated:
            return Outcome("timeout", False)
        return Outcome("reached", True) if tick.x_m > 0 else Outcome("lost", False)

    def command(self, tick: Tick, command: Command) -> Command:
        return command

    def digest_bytes(self, tick: Tick, command: Command) -> bytes:
        return struct.pack("<qd2d", tick.step, tick.x_m, *command)

    def critic_inputs(self, tick: Tick, mirror: bool) -> tuple[float, ...]:
        return ()

    def record(self, episode: Episode, tick: Tick) -> Episode:
        return episode


class FirstActive:
    def driver(self, tick: Tick, answers: Answers) -> int:
        return driver_of([Layer(0, lambda *_: True), Layer(1, lambda *_: True)], tick, answers)


@dataclass(frozen=True)
class Parameters(FbqlParameters):
    @property
    def success_limit(self) -> int:
        return self.goals_

    goals_: int = 0


def line_session(controller: str = "fbql", **changes: object) -> Session[Tick, Command, Episode]:
    values = {"controller": controller, "behaviors": ["left", "right"], "seed": 1, "guided": 0, "fbql_mirror": False}
    parameters = Parameters(**{**values, **changes})
    task, guide = Line(), FirstActive()
    return Session(parameters, task, guide, make_controller(parameters, task, guide))


def sources(x_m: float, left_is_active: bool = True) -> list[Source]:
    leaf = 0 if x_m < 0 else 1
    return [
        Source((-0.5, 0.1), 2 if not left_is_active else leaf, 3, "left", False, (x_m,), left_is_active),
        Source((0.5, -0.1), leaf, 3, "right", False, (x_m,), True),
    ]


def play(session: Session[Tick, Command, Episode], episodes: int, silent: bool = False) -> list[int]:
    """The drivers of all steps. `silent`: the left source has nothing to say where x is above 0."""
    drivers: list[int] = []
    for _ in range(episodes):
        begun = session.next_episode()
        if begun is None:
            break
        number, seed = begun
        x_m = float(np.random.default_rng(seed).uniform(-0.5, 0.5))
        for step in range(41):
            tick = Tick(step, number, step, x_m, abs(x_m) >= 1.0, step == 40)
            command, decision = session.decide(tick, sources(x_m, not (silent and x_m > 0)))
            drivers.append(decision.driver)
            if tick.ended:
                break
            x_m += 0.1 * command[0]
    return drivers


def test_another_task_is_learned_from_success_alone() -> None:
    session = line_session()
    play(session, 150)
    outcomes = [episode.outcome for episode in session.records]
    assert sum(outcome.success for outcome in outcomes[:20]) < 15
    assert sum(outcome.success for outcome in outcomes[-30:]) == 30


def test_a_session_ends_at_its_successes() -> None:
    session = line_session("subsumption", goals_=3)
    play(session, 50, silent=True)  # the first source drives to -1 from the left, the second to +1 from the right
    outcomes = [episode.outcome.name for episode in session.records]
    assert outcomes.count("reached") == 3
    assert outcomes[-1] == "reached"
    assert session.next_episode() is None


def test_a_silent_source_never_drives_and_does_not_degrade_the_episode() -> None:
    session = line_session()
    play(session, 100, silent=True)
    for episode in session.records:
        assert not episode.degraded
    number, _ = session.next_episode() or (0, 0)
    for step in range(30):
        _, decision = session.decide(Tick(step, number, step, 0.3, False, False), sources(0.3, left_is_active=False))
        assert decision.driver == 1


def test_a_decision_ends_when_its_source_falls_silent() -> None:
    session = line_session(fbql_hold_s=1000 / 60)
    drivers: set[int] = set()
    for _ in range(20):
        number, _ = session.next_episode() or (0, 0)
        _, first = session.decide(Tick(0, number, 0, 0.1, False, False), sources(0.1))
        _, after = session.decide(Tick(1, number, 1, 0.1, False, False), sources(0.1, left_is_active=False))
        session.decide(Tick(2, number, 2, 0.1, False, True), sources(0.1))
        drivers.add(first.driver)
        assert after.driver == 1
    assert drivers == {0, 1}


def test_a_guide_passes_over_a_silent_source() -> None:
    guide, tick = FirstActive(), Tick(0, 0, 0, 0.0, False, False)
    assert guide.driver(tick, sources(0.5)) == 0
    assert guide.driver(tick, sources(0.5, left_is_active=False)) == 1
    assert guide.driver(tick, [None, None]) == DRIVER_BLEND


def test_a_blend_leaves_a_silent_source_out_and_keeps_the_limits_of_the_axes() -> None:
    session = line_session("uniform")
    number, _ = session.next_episode() or (0, 0)
    command, decision = session.decide(Tick(0, number, 0, 0.3, False, False), sources(0.3, left_is_active=False))
    assert command == (0.5, -0.1)
    assert decision.weights == (0.0, 1.0)
    assert session.phase is Phase.EVALUATION


class AlwaysLeft:
    """Names the left source as the driver, whether it may drive or not."""

    def begin_episode(self, phase: Phase) -> None:
        pass

    def select(self, tick: Tick, joint_state: tuple[int, ...], answers: Answers) -> Selection:
        return (1.0, 0.0), 0, (), ()


def test_a_decision_never_names_a_source_that_may_not_drive() -> None:
    parameters = Parameters(controller="uniform", behaviors=["left", "right"], guided=0)
    session = Session(parameters, Line(), FirstActive(), AlwaysLeft())
    number, _ = session.next_episode() or (0, 0)
    command, decision = session.decide(Tick(0, number, 0, 0.3, False, False), sources(0.3))
    assert (command, decision.driver) == ((-0.5, 0.1), 0)
    command, decision = session.decide(Tick(1, number, 1, 0.3, False, False), sources(0.3, left_is_active=False))
    assert (command, decision.driver, decision.weights) == ((0.5, -0.1), DRIVER_BLEND, (0.0, 1.0))


SOCCERS = ("tasks/soccer/", "soccer_session.py", "parameters.py", "assembly.py")
GENERIC = [path for path in sorted(CORE.rglob("*.py")) if not str(path.relative_to(CORE)).startswith(SOCCERS)]


@pytest.mark.parametrize("path", GENERIC, ids=lambda path: str(path.relative_to(CORE)))
def test_nothing_outside_of_soccer_imports_what_only_soccer_has(path: Path) -> None:
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            names |= {str(node.module), *(alias.name for alias in node.names)}
    assert not names & OF_SOCCER
    assert not any(".soccer" in name for name in names)
