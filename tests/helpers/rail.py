"""A robot that takes velocity commands, without a simulator: a point on a rail, whose goal is at one of the ends.

Two sources drive it up and down, always; which of them is right is sensed (`side`), and so is where the robot is. The robot
jitters, by the seed of the episode, so that no two episodes are alike.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from fbql_common.core.command_space import Axis, CommandSpace
from fbql_fusion.core.guides.priorities import Priorities
from fbql_fusion.core.mux.learned import Clock
from fbql_fusion.core.mux_session import MuxSession
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.tasks.twist.answers import SourceLeaves
from fbql_fusion.core.tasks.twist.moment import MuxMoment
from fbql_fusion.core.tasks.twist.parameters import MuxLearningParameters
from fbql_fusion.core.tasks.twist.task import MuxTask


def at(now_ns: int, stamp_ns: int) -> Clock:
    """A clock that stands still, for a tick of a mux that learns."""
    return lambda: (now_ns, stamp_ns)


SOURCES = {"down": -0.5, "up": 0.5}
"""The speed of each source [m/s], in alphabetical order, as a mux has them."""
SPACE = CommandSpace((Axis("linear.x", "m/s", -1.0, 1.0, 5), Axis("angular.z", "rad/s", -2.0, 2.0, 5)))
PERIOD_S = 0.1
PERIOD_NS = 100_000_000
MAX_STEPS = 40
LENGTHS = (1, 1)


class Result(NamedTuple):
    """What a step brought."""

    reward: float = 0.0
    terminated: bool = False
    truncated: bool = False
    outcome: str = ""


class Rail:
    """One robot."""

    def __init__(self) -> None:
        self.x_m = 0.0
        self.side = 1.0
        self._steps = 0
        self._rng = np.random.default_rng(0)

    def reset(self, seed: int) -> None:
        """Begins an episode."""
        self._rng = np.random.default_rng(seed)
        self.side = float(self._rng.choice([-1.0, 1.0]))
        self.x_m = float(self._rng.uniform(-0.2, 0.2))
        self._steps = 0

    def step(self, speed_m_s: float) -> Result:
        """Drives for a period."""
        self._steps += 1
        self.x_m += speed_m_s * PERIOD_S + float(self._rng.normal(0.0, 0.01))
        if abs(self.x_m) >= 0.5:
            reached = self.x_m * self.side > 0.0
            return Result(10.0 if reached else -10.0, True, False, "success" if reached else "collision")
        return Result(truncated=self._steps >= MAX_STEPS)

    @property
    def observed(self) -> tuple[tuple[float, ...], ...]:
        """Two groups of one number each."""
        return (self.x_m,), (self.side,)


def learning(**changes: Any) -> MuxLearningParameters:
    """Parameters that learn the task in some hundred episodes."""
    values: dict[str, Any] = {
        "behaviors": list(SOURCES),
        "seed": 3,
        "learn": True,
        "hold_s": 0.3,
        "play_s": 0.2,
        "fbql_batch_episodes": 5,
    }
    return MuxLearningParameters(**(values | changes))


def session_of(policy: Policy | None = None, priorities: tuple[int, int] = (1, 2), **changes: Any) -> MuxSession:
    """A session of the task; `priorities` of down and up."""
    return MuxSession(learning(**changes), MuxTask(SPACE, PERIOD_S, LENGTHS), Priorities(priorities), policy)


def play(session: MuxSession, episodes: int, active: Any = None) -> list[tuple[Any, tuple[float, ...]]]:
    """Plays episodes; returns decision and command of each moment.

    `active` gives which sources may drive, by the moment's number from the beginning.
    """
    rail, leaves = Rail(), SourceLeaves(SPACE)
    found: list[tuple[Any, tuple[float, ...]]] = []
    stamp_ns = 0
    for _ in range(episodes):
        begun = session.next_episode()
        if begun is None:
            break
        rail.reset(begun[0])
        step, result = 0, Result()
        while True:
            stamp_ns += PERIOD_NS
            moment = MuxMoment(stamp_ns, begun[0], step, rail.observed, *result)
            mask = (True, True) if active is None else active(len(found))
            answers = [leaves.answer((speed, 0.0), may) for speed, may in zip(SOURCES.values(), mask, strict=True)]
            command, decision = session.decide(moment, answers)
            found.append((decision, command))
            if moment.ended:
                break
            result = rail.step(command[0])
            step += 1
    return found


def success_rate(session: MuxSession) -> float:
    """Share of successes among the episodes so far."""
    return sum(record.outcome == "success" for record in session.records) / len(session.records)
